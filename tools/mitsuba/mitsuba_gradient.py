#!/usr/bin/env python3
"""The same derivative image by Mitsuba 3's prb_projective (Zhang et al. 2023), for comparing limn
with it.

    tools/mitsuba/mitsuba_gradient.py SCENE --wrt SHAPE.translate.y --time 10 -o out.exr --json out.json

PARAM: SHAPE.translate.x|y|z, SHAPE.rotate.x|y|z (radians, about world axes through the center of
the shape's bounding box), SHAPE.scale (about that center). Needs `pip install mitsuba==3.9.1` and
LLVM (Debian: libllvm19).

How the time is spent: one pass of each of the three terms, in which kernels are compiled and the
octree is built (once, not per pass); a second one that is timed; then passes in the numbers that
minimise the variance of the sum for the time that is left (n ~ sqrt(variance / time), from the
first two passes, which do not enter the result). Compilation is measured but not counted: it
depends on what Dr.Jit has cached on disk, and Mitsuba is to be shown at its best.

Exit status: 0 done, 2 bad input, 3 Mitsuba or LLVM is not installed, 4 the parameter is not
supported by this method.
"""

import time

START = time.monotonic()

import argparse  # noqa: E402
import glob  # noqa: E402
import json  # noqa: E402
import os  # noqa: E402
import re  # noqa: E402
import resource  # noqa: E402
import sys  # noqa: E402

BAD_INPUT, NOT_INSTALLED, NOT_SUPPORTED = 2, 3, 4
VARIANT = "llvm_ad_rgb"
LIBRARIES = (
    "/usr/lib/*/libLLVM*.so*", "/usr/lib/llvm-*/lib/libLLVM*.so*", "/usr/lib64/libLLVM*.so*",
    "/opt/homebrew/opt/llvm/lib/libLLVM*.dylib",
)
# Term: the sample counts of prb_projective that switch the two others off.
TERMS = {"interior": ("sppp", "sppi"), "camera": ("sppc", "sppi"), "boundary": ("sppc", "sppp")}
# Samples of one pass, and of the pass that builds the octree (Mitsuba's own default of 512 per
# pixel where that is fewer): a few hundred bytes each are alive at once.
PASS_SAMPLES, GUIDING_SAMPLES = 1 << 19, 1 << 23


class Failure(Exception):
    def __init__(self, status, message):
        super().__init__(message)
        self.status = status


def find_llvm():
    """The newest: LLVM 15 aborts on some of Mitsuba 3.9.1's kernels where the processor has AVX-512.
    """

    def version(file):
        return [int(n) for n in re.findall(r"\d+", os.path.basename(os.path.realpath(file)))]

    return max((f for pattern in LIBRARIES for f in glob.glob(pattern)), key=version, default=None)


def load_mitsuba():
    library = os.environ.get("DRJIT_LIBLLVM_PATH") or find_llvm()
    os.environ.update({"DRJIT_LIBLLVM_PATH": library} if library else {})
    try:
        import mitsuba
    except ImportError as error:
        raise Failure(NOT_INSTALLED, f"Mitsuba is not installed for {sys.executable} ({error}):"
                      " pip install mitsuba==3.9.1") from None
    if not library:
        raise Failure(NOT_INSTALLED, "LLVM, with which Mitsuba compiles its kernels, is not"
                      " installed: on Debian apt-get install libllvm19; elsewhere set"
                      " DRJIT_LIBLLVM_PATH to its shared library")
    mitsuba.set_variant(VARIANT)
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    import drjit

    return mitsuba, drjit


class Clock:
    """Seconds since the start of the program, less what compilation took until `stop_counting`."""

    def __init__(self, drjit):
        self._drjit, self.compilation = drjit, 0.0
        drjit.set_flag(drjit.JitFlag.KernelHistory, True)

    def seconds(self):
        if self._drjit.flag(self._drjit.JitFlag.KernelHistory):
            kernels = self._drjit.kernel_history()
            self.compilation += sum(k.get("backend_time", 0) for k in kernels) / 1000
        return time.monotonic() - START - self.compilation

    def stop_counting(self):
        self.seconds()
        self._drjit.set_flag(self._drjit.JitFlag.KernelHistory, False)


def parse_parameter(name):
    """(shape, operation, axis as 0, 1, 2 or None)."""
    match = re.fullmatch(r"(.+)\.(?:(translate|rotate)\.([xyz])|scale)", name)
    if not match:
        raise Failure(NOT_SUPPORTED, f"{name}: not supported by this method (known:"
                      " SHAPE.translate.x, .y, .z, SHAPE.rotate.x, .y, .z, SHAPE.scale)")
    shape, operation, axis = match.groups()
    return shape, operation or "scale", "xyz".index(axis) if axis else None


class Motion:
    """The scene with one shape in motion. `attach()` puts the motion's velocity on the scene's
    parameters; a pass of rendering uses it up."""

    def __init__(self, mi, dr, scene, parameter):
        self._mi, self._dr = mi, dr
        self._shape, self._operation, axis = parse_parameter(parameter)
        self._axis = mi.Vector3f(*(float(i == axis) for i in range(3)))
        shapes = {s.id(): s for s in scene.shapes()}
        no = f"{parameter}: not supported by this method: "
        if self._shape not in shapes:
            known = ", ".join(shapes)
            raise Failure(NOT_SUPPORTED, f'{no}no shape "{self._shape}" (known: {known})')
        self._params = mi.traverse(scene)
        self._center = mi.Point3f(shapes[self._shape].bbox().center())
        self._velocities = None
        if f"{self._shape}.vertex_positions" in self._params:
            self._attach_mesh()
        elif f"{self._shape}.to_world" in self._params:
            self._rest = mi.Transform4f(self._params[f"{self._shape}.to_world"].matrix)
        else:
            raise Failure(NOT_SUPPORTED, f"{no}the shape has neither vertices nor to_world")

    def _velocity(self, positions):
        if self._operation == "scale":
            return positions - self._center
        if self._operation == "rotate":
            return self._dr.cross(self._axis, positions - self._center)
        return self._axis

    def _attach_mesh(self):
        """Vertices move; what Mitsuba derives from them (computed normals) gets its velocity from
        it, once."""
        mi, dr, key = self._mi, self._dr, f"{self._shape}.vertex_positions"
        positions = dr.unravel(mi.Point3f, self._params[key])
        t = mi.Float(0)
        dr.enable_grad(t)
        normals = mi.Float(self._params[f"{self._shape}.vertex_normals"])
        self._params[key] = dr.ravel(positions + t * self._velocity(positions))
        self._params.update()
        self._keep_normals_of_the_file(normals, t)
        dr.forward(t, dr.ADFlag.ClearEdges)
        moving = [k for k in self._params.keys()
                  if k.startswith(f"{self._shape}.") and dr.grad_enabled(self._params[k])]
        self._velocities = {k: mi.Float(dr.grad(self._params[k])) for k in moving}
        dr.eval(self._velocities)

    def _keep_normals_of_the_file(self, normals, t):
        """Mitsuba 3.9.1 computes a mesh's normals anew when its vertices move, those from a file too.
        Where that changed them by more than rounding, they are put back, and turn with the shape as
        limn's do."""
        mi, dr, key = self._mi, self._dr, f"{self._shape}.vertex_normals"
        rounding = dr.epsilon(mi.Float) ** 0.5
        if len(normals) == 0 or dr.all(dr.abs(self._params[key] - normals) < rounding):
            return
        directions = dr.unravel(mi.Normal3f, normals)
        if self._operation == "rotate":
            directions = directions + t * dr.cross(self._axis, mi.Vector3f(directions))
        self._params[key] = dr.ravel(mi.Normal3f(directions))
        self._params.update()

    def _attach_transform(self):
        mi, dr, c = self._mi, self._dr, self._center
        t = mi.Float(0)
        dr.enable_grad(t)
        about = {"scale": lambda at: at.scale(1 + t),
                 "rotate": lambda at: at.rotate(self._axis, dr.rad2deg(t))}.get(self._operation)
        step = (about(mi.Transform4f().translate(c)).translate(-c) if about else
                mi.Transform4f().translate(t * self._axis))
        self._params[f"{self._shape}.to_world"] = step @ self._rest
        self._params.update()
        dr.forward(t, dr.ADFlag.ClearEdges)

    def attach(self):
        if self._velocities is None:
            self._attach_transform()
            return
        for key, velocity in self._velocities.items():
            self._dr.set_grad(self._params[key], velocity)


def path_settings(mi, file, defines):
    """The properties of the scene's integrator, for a prb_projective of the same paths."""
    state = mi.parser.parse_file(mi.parser.ParserConfig(VARIANT), file, **defines)
    for node in state.nodes:
        if node.type == mi.ObjectType.Integrator:
            return {key: node.props[key] for key in node.props.keys()}
    return {}


class Term:
    """Passes of one of the three terms, each an independent estimate of it."""

    def __init__(self, mi, name, settings, guiding, guiding_spp):
        off = {count: 0 for count in TERMS[name]}
        self.name, self.sum, self.passes, self.seconds, self.pass_seconds = name, 0.0, 0, 0.0, 0.0
        self._integrator = mi.load_dict({"type": "prb_projective", "guiding": guiding, **settings, **off})
        self._integrator.proj_seed_spp = min(self._integrator.proj_seed_spp, guiding_spp)
        self._build_octree = self._integrator.proj_detail.init_indirect_silhouette
        self._integrator.proj_detail.init_indirect_silhouette = self._build_octree_once

    def _build_octree_once(self, *arguments):
        """prb_projective builds its octree anew for every image; one serves all passes."""
        self._build_octree(*arguments)
        self._integrator.proj_detail.init_indirect_silhouette = lambda *_: None

    def estimate(self, scene, motion, seed, spp):
        """H by W by 3, float64."""
        import numpy as np

        motion.attach()
        image = np.array(self._integrator.render_forward(scene, None, seed=seed, spp=spp),
                         dtype=np.float64)
        return image[..., :3] if image.shape[2] >= 3 else np.repeat(image[..., :1], 3, axis=2)


class Renderer:
    def __init__(self, mi, dr, arguments):
        self._clock, self._guiding = Clock(dr), arguments.guiding
        defines = dict(arguments.D)
        try:
            settings = path_settings(mi, arguments.scene, defines)
            self.scene = mi.load_file(arguments.scene, optimize=False, **defines)
        except Exception as error:
            raise Failure(BAD_INPUT, f"{arguments.scene}: {error}") from None
        if arguments.threads:
            dr.set_thread_count(arguments.threads)  # With one thread loading waits for itself, too.
        self.motion = Motion(mi, dr, self.scene, arguments.wrt)
        width, height = self.scene.sensors()[0].film().crop_size()
        # A power of two: other counts need other kernels.
        self._spp = 1 << max(0, (PASS_SAMPLES // (width * height)).bit_length() - 1)
        if arguments.spp:
            self._spp = min(self._spp, 1 << (arguments.spp.bit_length() - 1))
        guiding_spp = max(1, GUIDING_SAMPLES // (width * height))
        self._terms = [Term(mi, name, settings, arguments.guiding, guiding_spp) for name in TERMS]
        self._seed = arguments.seed * 1000003  # Seeds of different runs do not meet.

    def _pass(self, term):
        self._seed += 1
        start = self._clock.seconds()
        image = term.estimate(self.scene, self.motion, self._seed % 2**32, self._spp)
        term.pass_seconds = self._clock.seconds() - start
        term.seconds += term.pass_seconds
        return image

    def _counted_pass(self, term):
        term.sum = term.sum + self._pass(term)
        term.passes += 1

    def _shares(self):
        """Relative numbers of passes, from two passes of each term: sqrt(variance / time)."""
        shares = []
        for term in self._terms:
            first = self._pass(term)
            variance = ((self._pass(term) - first) ** 2).mean() / 2
            shares.append((variance / term.pass_seconds) ** 0.5)
        self._clock.stop_counting()
        largest = max(shares) or 1.0
        # A term that two passes did not see may still be there: it gets a few.
        return [max(share / largest, 0.02) for share in shares]

    def render_for(self, seconds, after_setup):
        shares = self._shares()
        setup = self._clock.seconds()
        if after_setup:
            seconds += setup
        for term in self._terms:
            self._counted_pass(term)
        while True:
            _, term = max(zip(shares, self._terms), key=lambda pair: pair[0] / pair[1].passes)
            if self._clock.seconds() + term.pass_seconds / 2 > seconds:
                return setup
            self._counted_pass(term)

    def render_samples(self, spp):
        setup = self._clock.seconds()
        for _ in range(-(-spp // self._spp)):
            for term in self._terms:
                self._counted_pass(term)
        return setup

    def image(self):
        return sum(term.sum / term.passes for term in self._terms)

    def figures(self, setup, version, after_setup):
        samples = {term.name: term.passes * self._spp for term in self._terms}
        seconds, compilation = self._clock.seconds(), self._clock.compilation
        left_out = f"compilation of {compilation:.1f} s"
        if after_setup:
            left_out += f" and set-up of {setup:.1f} s"
        return {
            "seconds": seconds - setup if after_setup else seconds,
            "setup_seconds": 0 if after_setup else setup,
            "setup_not_counted_seconds": setup if after_setup else 0,
            "compile_seconds": compilation,
            "spp": samples["interior"],
            "samples": samples,
            "terms": {term.name: term.seconds for term in self._terms},
            "passes": sum(term.passes for term in self._terms),
            "version": version,
            "peak_memory_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
            "message": f"prb_projective, guiding {self._guiding}, {VARIANT}; {left_out} not counted",
        }


def write(mi, dr, image, file):
    import numpy as np

    dr.set_thread_count(2)  # With one, Bitmap.write of Mitsuba 3.9.1 waits for itself for ever.
    try:
        mi.Bitmap(image.astype(np.float32), pixel_format=mi.Bitmap.PixelFormat.RGB).write(file)
    except RuntimeError as error:
        raise Failure(BAD_INPUT, f"{file}: cannot be written: {error}") from None


def run(arguments):
    parse_parameter(arguments.wrt)
    mi, dr = load_mitsuba()
    renderer = Renderer(mi, dr, arguments)
    setup = (renderer.render_samples(arguments.spp) if arguments.spp else
             renderer.render_for(arguments.time, arguments.after_setup))
    figures = renderer.figures(setup, mi.__version__, arguments.after_setup)
    write(mi, dr, renderer.image(), arguments.output)
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as stream:
            json.dump(figures, stream, indent=2)
    samples = ", ".join(f"{name} {count}" for name, count in figures["samples"].items())
    print(f"{arguments.output}: {figures['seconds']:.2f} s, of which {figures['setup_seconds']:.2f} s"
          f" set-up; samples per pixel {samples}; {figures['message']}")


def define(text):
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f'"{text}" is not NAME=VALUE')
    return name, value


def positive(kind):
    def parse(text):
        value = kind(text)
        if not value > 0:
            raise ValueError
        return value

    parse.__name__ = f"positive {kind.__name__}"
    return parse


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--wrt", required=True, metavar="PARAM")
    budget = parser.add_mutually_exclusive_group(required=True)
    budget.add_argument("--time", type=positive(float), metavar="SECONDS",
                        help="set-up included, compilation not")
    parser.add_argument("--after-setup", action="store_true",
                        help="--time begins after the set-up, which is not counted either")
    budget.add_argument("--spp", type=positive(int), help="samples per pixel of each term, instead")
    parser.add_argument("--threads", type=positive(int), help="default: all cores")
    parser.add_argument("--guiding", choices=("octree", "grid", "none"), default="octree",
                        help="of the boundary term (default octree, which leaves out what it has"
                        " not met)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-D", action="append", type=define, default=[], metavar="NAME=VALUE")
    parser.add_argument("-o", "--output", required=True, metavar="FILE.exr")
    parser.add_argument("--json", metavar="FILE.json")
    try:
        run(parser.parse_args())
    except Failure as failure:
        print(f"tools/mitsuba/mitsuba_gradient.py: {failure}", file=sys.stderr)
        return failure.status
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
