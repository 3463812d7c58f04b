"""The runs of tools/paper, beside those of figures.py, and the names of limn's methods in them."""

from dataclasses import dataclass, field

# Limn's methods, as `limn compare --methods` takes them.
FOREST, DEFAULT = "forest", "adaptive"
PAPER = "quadric"  # the paper's sampler, one sample of each term unless the pilot says otherwise
LI2019, UNIFORM, BRUTE, DIFFERENCES = "li2019", "uniform", "brute", "fd"
WARPED, WARPED_UNBIASED = "was", "was:bias=off"
MITSUBA, MITSUBA_AFTER_SETUP = "mitsuba", "mitsuba-after-setup"
# Ablations of the default: each with those before it, from the forest to all of them.
ABLATIONS = ["silhouettes", "silhouettes:directions=moving",
             "adaptive:film=fixed:generator=independent", "adaptive:generator=independent", DEFAULT]
# Ablations of the forest and of the paper's sampler.
FOREST_NO_LIGHTS, FOREST_NO_ENVIRONMENT = "forest:lights=off", "forest:environment=off"
FOREST_CONCAVE = "forest:concave=on"
PAPER_NO_LIGHTS, PAPER_CONCAVE, PAPER_BOX = "quadric:lights=off", "quadric:concave=on", "quadric:quadrics=off"
LI2019_SOLID = "li2019:sphere=solid"

GENERATED = "build/generated"
BUNNY = "/usr/share/glmark2/models/bunny.obj"  # glmark2-data
UP, ASIDE, TURN, CAMERA = ("object.translate.y", "object.translate.x", "object.rotate.y",
                           "sensor.translate.x")


@dataclass
class Part:
    """One run: a call of limn or of edge_benchmark, or a count of edges. A fit's input starts from a
    sphere; its target is a rendering of the scene of that name without _start. A budget has the
    reference of another part."""

    name: str
    kind: str  # "compare", "gradient", "fit", "budget", "reject", "draws" or "edges"
    input: str  # scene; for the last three a mesh may stand here
    parameter: str = ""
    methods: list = field(default_factory=list)
    defines: dict = field(default_factory=dict)
    wide: bool = False  # four to three, not square
    small_mesh: str = ""  # NAME FACES of a mesh to make for it: the scene's $mesh, or the input
    needs: str = ""  # a file that may not be there
    longer: float = 1  # times the seconds of other comparisons: where set-up would decide
    options: list = field(default_factory=list)  # further arguments


@dataclass
class Comparison:
    """A scene of the sweep over times and, where it has a title, of the table of ablations."""

    name: str
    title: str
    scene: str
    parameter: str
    more: list = field(default_factory=list)  # methods of the sweep beside SWEPT
    in_mitsuba: bool = False  # whether Mitsuba can move the parameter
    settings: dict = field(default_factory=dict)  # of the Part

    def part(self, prefix, methods):
        return Part(prefix + self.name, "compare", f"scenes/{self.scene}.xml", self.parameter,
                    methods, **self.settings)

    def swept(self):
        return self.part("", [FOREST, *ABLATIONS, *self.more, LI2019, UNIFORM, DIFFERENCES])

    def ablated(self, mitsuba):
        beside = [MITSUBA_AFTER_SETUP] if mitsuba and self.in_mitsuba else []
        return self.part("ablations-", [FOREST, *ABLATIONS, DIFFERENCES, *beside])


def _alpha(alpha):
    return {"defines": {"alpha": str(alpha)}}


WIDE = {"wide": True}
SMALL = {"small_mesh": "pebble 1500"}  # Brute force evaluates every edge: it needs a mesh of few.
COMPARISONS = [
    Comparison("mirror-0.01", "rough mirror, alpha 0.01", "rough_mirror", UP, [], True,
               _alpha(0.01)),
    Comparison("mirror-0.05", "rough mirror, alpha 0.05", "rough_mirror", UP, [], True,
               _alpha(0.05)),
    Comparison("mirror-0.2", "rough mirror, alpha 0.2", "rough_mirror", UP, [], False, _alpha(0.2)),
    Comparison("mirror-bunny", "", "rough_mirror", UP, [], False,
               {"defines": {"mesh": BUNNY, "format": "obj"}, "needs": BUNNY}),
    Comparison("mirror-small", "", "rough_mirror", UP, [BRUTE], False, SMALL),
    Comparison("shadow", "soft shadow", "soft_shadow", ASIDE, [FOREST_NO_LIGHTS], True),
    Comparison("shadow-small", "", "soft_shadow", ASIDE, [FOREST_NO_LIGHTS, BRUTE], False, SMALL),
    Comparison("sharp-shadow", "", "sharp_shadow", ASIDE),
    Comparison("concave", "concave", "concave", UP, [FOREST_CONCAVE]),
    Comparison("chandelier", "chandelier", "intricate", UP),
    Comparison("harp", "harp", "intricate", UP, [], False,
               {"defines": {"mesh": f"../{GENERATED}/harp.ply"}}),
    Comparison("sun", "strong sun", "sun", ASIDE, [FOREST_NO_ENVIRONMENT]),
    Comparison("lights", "several lights", "lights", ASIDE, [FOREST_NO_LIGHTS], False, WIDE),
    Comparison("in-view", "all in view, camera moves", "in_view", CAMERA, [], False, WIDE),
    Comparison("in-view-object", "all in view, object moves", "in_view", ASIDE, [], True, WIDE),
    Comparison("cad", "CAD part", "cad", TURN, [], False, WIDE),
    Comparison("plant", "plant", "plant", TURN),
    # What its glass shows by smooth refraction has edges that no term has.
    Comparison("still-life", "", "still_life", ASIDE, [], False, WIDE),
    Comparison("demo", "demo (bunny)", "demo", UP, [], False, {"needs": BUNNY}),
]
ABLATED = [comparison for comparison in COMPARISONS if comparison.title]
PARTS = [comparison.swept() for comparison in COMPARISONS] + [
    Part(f"reject-{name}", "reject", mesh, needs=mesh if mesh == BUNNY else "")
    for name, mesh in (("creature", f"{GENERATED}/creature.ply"), ("bunny", BUNNY),
                       ("pebble", f"{GENERATED}/pebble.ply"),
                       ("chandelier", f"{GENERATED}/chandelier.ply"))]
