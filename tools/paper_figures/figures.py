"""The list: what the paper shows in each figure and table, and the runs that show it here."""

import copy
import os
from dataclasses import dataclass, replace

from .parts import (ASIDE, BUNNY, DEFAULT, DIFFERENCES, FOREST, FOREST_CONCAVE, FOREST_NO_LIGHTS,
                    LI2019, LI2019_SOLID, MITSUBA, PAPER, PAPER_BOX, PAPER_CONCAVE, PAPER_NO_LIGHTS,
                    UP, WARPED, WARPED_UNBIASED, Part)


@dataclass
class Figure:
    """numbers: as the paper prints them. shows: the paper. reading: what to look at here."""

    numbers: str
    title: str
    shows: str
    reading: str
    runs: list
    table: str = "time"  # of comparisons: "time" (equal error) or "samples" (equal samples)


DRAWS = [PAPER, PAPER_BOX, FOREST, LI2019]
BOXES = [PAPER, PAPER_BOX, LI2019, LI2019_SOLID, FOREST]
AGAINST_LI = [PAPER, LI2019, FOREST, DEFAULT]


def mirror(name, alpha, methods, mesh="", options=(), given=None):
    """given: defines of a mesh that there is; mesh: of one to make."""
    return Part(name, "compare", "scenes/rough_mirror.xml", UP, methods,
                {"alpha": str(alpha), **(given or {})}, options=list(options), small_mesh=mesh)


def patch(name, mesh):
    """A patch of some hundred edges of a smooth mesh, and two slices of space beside it."""
    return Part(name, "reject", "", methods=BOXES, options=["--node-edges", "128"], small_mesh=mesh)


def bias(name, method, *options):
    return Part(f"fig10-bias-{name}", "gradient", "scenes/closed_form/lamp_over_plane.xml",
                "lamp.translate.x", options=["--method", method, *options])


FIGURES = [
    Figure(
        "Figures 7 and 8",
        "What a node's test rejects",
        "For a spherical and a toroidal patch, two slices of space each: where a box around the "
        "planes rejects, where box and quadrics do, Li 2019, and Li 2019 with the mistake of redner "
        "(a solid sphere in place of a hollow one). Quadrics gain most on the torus.",
        "Orange: false positives. A node of the paper's forest and the nearest one of each other "
        "tree.",
        [patch("fig7-sphere", "sphere 8192"), patch("fig7-torus", "torus 8192"),
         Part("fig8-creature", "reject", "", methods=BOXES, small_mesh="creature 8000")],
    ),
    Figure(
        "Figures 1 and 9",
        "Equal time against Li 2019, in a rough mirror",
        "Derivatives of four objects that are seen in a mirror of roughness 0.01, for a vertical "
        "translation, with 128 samples per pixel: those of Li 2019 drown in noise, the paper's are "
        "close to finite differences.",
        "Time that a method needs for the error of the first.",
        [mirror(f"fig9-{name}", 0.01, AGAINST_LI, f"{name} {faces}")
         for name, faces in (("creature", 8000), ("pretzel", 8000), ("knot", 8000),
                             ("tetrapod", 8000))],
    ),
    Figure(
        "Figure 10",
        "Warped-area sampling",
        "The same scene in equal time by warped-area sampling with 8 and 32 auxiliary rays "
        "(kappa 1e5): noise and bias where edge sampling has little of either. No numbers.",
        f"`{WARPED}` is biased by design and marked where the scores see it; `{WARPED_UNBIASED}` is "
        "the roulette that takes the bias out. At the end the bias over rays, where the derivative is "
        "known.",
        [mirror(f"fig10-{rays}-rays-alpha-{alpha}", alpha,
                [PAPER, FOREST, DEFAULT, WARPED, WARPED_UNBIASED],
                options=["--aux", str(rays), "--kappa", "1e5"])
         for alpha in ("0.01", "0.05") for rays in (8, 32)]
        + [bias("reference", FOREST),
           *(bias(str(rays), WARPED, "--aux", str(rays)) for rays in (2, 8, 32, 128)),
           bias("unbiased", WARPED_UNBIASED, "--aux", "8")],
    ),
    Figure(
        "Figure 11 and Table 1",
        "Projective sampling",
        "Mitsuba 3's projective sampling with octree guiding has less error than the paper's method "
        "for an equal budget of samples. Table 1: the paper's trees take 0.24 to 1.9 s to build and "
        "its runs 142 to 153 s, projective sampling 10 to 17 s and 18 to 32 s (16 threads).",
        "After equal time, set-up included, which is reading, trees and a pilot; then with an equal "
        "budget, as in the paper: of prb_projective as many projections, and pairs of light paths, "
        "shared by the octree's leaves and the image. Trees alone are timed in the next section.",
        [mirror("fig11", 0.01, [PAPER, DEFAULT, MITSUBA], "creature 8000"),
         replace(mirror("fig11-budget", 0.01, [PAPER, DEFAULT], "creature 8000"), kind="budget")],
        table="samples",
    ),
    Figure(
        "The paper's code",
        "what a sample costs, and how often it ends on an edge",
        "Run on a machine of this kind it takes 24 microseconds for a sample on one core, about 150 "
        "Embree rays, and 12 of them for the descent; its trees take "
        "0.12 s to build for 6,000 edges and 3.1 s for 60,000. A model of its test ends on an edge "
        "in .67 (spot), .68 (bunny) and .72 (hand) of its draws.",
        "Draws alone, on one core; a ray is an incoherent one at the same mesh. Why hits differ: "
        "edgetree/FIGURES.md, \"The paper's forest\".",
        [Part("draws-" + mesh.replace(" ", "-"), "draws", "", methods=DRAWS, small_mesh=mesh)
         for mesh in ("creature 4000", "creature 40000")],
    ),
    Figure(
        "Figure 12",
        "Weights by the position of the light",
        "The soft shadow of an object before a small area light, after 64 samples per pixel: the light "
        "term lowers the squared error 50 times for a harp and 20 times for an elephant.",
        "After equal samples, as in the paper, and after equal time.",
        [Part(f"fig12-{name}", "compare", "scenes/soft_shadow.xml", ASIDE,
              [PAPER, PAPER_NO_LIGHTS, FOREST, FOREST_NO_LIGHTS, DEFAULT],
              small_mesh=f"{name} {faces}")
         for name, faces in (("creature", 8000), ("harp", 30000))],
        table="samples",
    ),
    Figure(
        "Figure 13",
        "Concave edges left out",
        "Derivatives of objects in a mirror with and without concave edges, 16 samples per pixel: "
        "less error without, by how much depends on the mesh.",
        "After equal samples, and after equal time.",
        [Part("fig13", "compare", "scenes/concave.xml", UP,
              [PAPER, PAPER_CONCAVE, FOREST, FOREST_CONCAVE, DEFAULT])],
        table="samples",
    ),
    Figure(
        "Figure 14",
        "A shape before two mirrors",
        "A shape from one image of it and of its two reflections, by gradient descent over "
        "reparameterised vertices (Nicolet et al. 2021) with remeshing, shown in the scene and under "
        "other lights. No numbers.",
        "Six samples per pixel, 64 x 32 pixels, remeshed three times. The second row is a view and a "
        "light that no fit has used; its last picture is the truth. Longer fits: "
        "scenes/fits/README.md.",
        [Part(f"fig14-{method}", "fit", "scenes/fits/two_mirrors_start.xml", "object.vertex_positions",
              [method], {"width": "64", "height": "32"},
              options=["--spp", "6", "--steps", "120", "--remesh", "30,60,90", "--snapshots", "40",
                       "--step", "2", "--smoothing", "0.1"])
         for method in (PAPER, DEFAULT, LI2019)],
    ),
    Figure(
        "Figure 15",
        "The chandelier",
        "An intricate object in a mirror: after as many samples the noise is larger by orders of "
        "magnitude. The paper calls it a failure.",
        "Here warped-area sampling has less error than plain edge sampling; finite differences less "
        "than both; reparameterised directions (adaptive) less than plain edge sampling.",
        [Part("fig15", "compare", "scenes/intricate.xml", UP,
              [PAPER, FOREST, DEFAULT, WARPED, WARPED_UNBIASED, DIFFERENCES], longer=3,
              options=["--aux", "32", "--kappa", "1e4"])],
    ),
    Figure(
        "Table 2",
        "Edges with and without concave ones",
        "Spot 8716 and 6186 edges, hand 23296 and 15755, bunny 11509 and 7618, bob 13118 and 8963, "
        "cube 71008 and 45028, birds 92894 and 53471.",
        "Ours, and meshes that are given (--mesh FILE). Edges within a plane are none; on closed "
        "meshes concave ones are never silhouettes from outside.",
        [Part("table2-" + name.split()[0], "edges", "", small_mesh=name)
         for name in ("creature 40000", "pretzel 30000", "chandelier 70000", "harp 60000")]
        + [Part("table2-bunny", "edges", BUNNY, needs=BUNNY)],
    ),
]


def with_meshes(files):
    """The list with the meshes that a user gives, in Fig. 9 and Table 2."""
    figures = copy.deepcopy(FIGURES)
    for file in files:
        name = os.path.splitext(os.path.basename(file))[0]
        given = {"mesh": os.path.abspath(file), "format": os.path.splitext(file)[1][1:].lower()}
        for figure in figures:
            if figure.numbers == "Figures 1 and 9":
                figure.runs.append(mirror(f"fig9-given-{name}", 0.01, AGAINST_LI, given=given))
            if figure.numbers == "Table 2":
                figure.runs.append(Part(f"table2-given-{name}", "edges", os.path.abspath(file)))
    return figures
