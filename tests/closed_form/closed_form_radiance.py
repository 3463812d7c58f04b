"""The formulas: Lambert's polygon formula, microfacet lobes, filtered coverage.

Symbols: p shading point, n its unit normal, w_k = x_k - p the corners of a polygon seen from p,
omega unit directions from p, omega_o the direction to the viewer, f_s the BSDF times n.omega.
"""
import numpy as np

from closed_form_geometry import clip_box, gauss, loop_normal, loop_rule, unit


def polygon_vector(p, loop):
    """Integral of omega over the solid angle of a polygon seen from its front (Lambert 1760).

    p: N by 3; loop: K by 3, counter-clockwise seen from the points p. Returns N by 3,
        Phi = -1/2 sum_k Theta_k gamma_k,   Theta_k = angle(w_k, w_k+1),
        gamma_k = w_k x w_k+1 / |w_k x w_k+1|,
    so n.Phi is the integral of n.omega; a polygon that fills the hemisphere gives pi.
    """
    phi = np.zeros_like(p)
    for a, b in zip(loop, np.roll(loop, -1, axis=0)):
        wa, wb = a - p, b - p
        cross = np.cross(wa, wb)
        size = np.linalg.norm(cross, axis=1)
        theta = np.arctan2(size, np.sum(wa * wb, axis=1))
        phi -= 0.5 * (theta / size)[:, None] * cross
    return phi


def convex_vector(p, shape):
    """polygon_vector of the outline of a convex mesh (an open one is closed by shape.hole).

    The outline's edges are those between a front and a back face of p; summing the formula over the
    front faces leaves just them. All p must see the same front faces: then the result is smooth.
    """
    phi = np.zeros_like(p)
    for face in shape.faces + shape.hole:
        loop = shape.vertices[face]
        side = (p - loop[0]) @ loop_normal(loop)
        assert np.all(side > 0) or np.all(side < 0), "the outline changes within a pixel"
        if side[0] > 0:
            phi += polygon_vector(p, loop)
    return phi


def smith_g1(kind, alpha, cosine):
    """Smith's masking as Mitsuba 3 has it (rational approximation for Beckmann)."""
    tan2 = 1 / cosine**2 - 1
    if kind == "ggx":
        return 2 / (1 + np.sqrt(1 + alpha**2 * tan2))
    a = 1 / (alpha * np.sqrt(tan2))
    return np.where(a >= 1.6, 1.0, (3.535 * a + 2.181 * a * a) / (1 + 2.276 * a + 2.577 * a * a))


def lobe(bsdf, n, to_viewer, omega):
    """f_s [1/sr] = BSDF times n.omega, per channel: M by 3. Directions M by 3 (or broadcast)."""
    cos_o = np.sum(n * omega, axis=-1)
    assert np.all(cos_o > 0), "below the horizon"
    if bsdf.kind == "diffuse":
        return cos_o[..., None] * bsdf.reflectance / np.pi
    cos_i = np.sum(n * to_viewer, axis=-1)
    assert np.all(cos_i > 0), "below the horizon"
    h = unit(to_viewer + omega)
    c2 = np.sum(n * h, axis=-1) ** 2
    a2 = bsdf.alpha**2
    if bsdf.kind == "ggx":
        d = a2 / (np.pi * (1 + (a2 - 1) * c2) ** 2)
    else:
        d = np.exp(-(1 / c2 - 1) / a2) / (np.pi * a2 * c2 * c2)
    g = smith_g1(bsdf.kind, bsdf.alpha, cos_i) * smith_g1(bsdf.kind, bsdf.alpha, cos_o)
    return (d * g / (4 * cos_i))[..., None] * np.ones(3)


def lobe_over_polygon(p, n, to_viewer, bsdf, loop, order, emitted):
    """Integral of f_s(omega) times emitted(x) over a polygon's solid angle, by quadrature on it.

    d omega = n_l.(p - x) / |x - p|^3 dA. p, n, to_viewer: N by 3 (n: 3); emitted: function of the
    nodes (M by 3) that returns M by 3. Returns N by 3.
    """
    x, area = loop_rule(loop, order)
    light_normal = loop_normal(loop)
    radiance = emitted(x)
    result = np.zeros_like(p)
    for k in range(len(p)):
        w = x - p[k]
        r = np.linalg.norm(w, axis=1)
        facing = -(w @ light_normal)
        assert np.all(facing > 0)
        f = lobe(bsdf, n, to_viewer[k], w / r[:, None])
        result[k] = np.sum((area * facing / r**3)[:, None] * f * radiance, axis=0)
    return result


class Filter:
    """Reconstruction filters along one axis, normalised to integral 1. cells: smooth pieces."""

    def __init__(self, kind):
        self.kind = kind
        self.cells = {"box": [-0.5, 0.5], "tent": [-1, 0, 1], "gaussian": [-2, 2]}[kind]
        x, w = gauss(40)
        self.total = 1.0
        self.total = sum((b - a) * np.sum(w * self(a + (b - a) * x))
                         for a, b in zip(self.cells, self.cells[1:]))

    def __call__(self, x):
        if self.kind == "box":
            return np.ones_like(x) / self.total
        if self.kind == "tent":
            return (1 - np.abs(x)) / self.total
        return (np.exp(-2 * x * x) - np.exp(-8.0)) / self.total  # stddev 1/2, radius 2

    def over_polygon(self, polygon, center):
        """Integral of f(x - cx) f(y - cy) over a convex polygon (K by 2, pixels)."""
        if self.kind == "box":
            return polygon_area(clip_box(polygon, center - 0.5, center + 0.5))
        order = 6 if self.kind == "tent" else 24
        total = 0.0
        for ax, bx in zip(self.cells, self.cells[1:]):
            for ay, by in zip(self.cells, self.cells[1:]):
                part = clip_box(polygon, center + [ax, ay], center + [bx, by])
                if len(part):
                    x, w = loop_rule(part, order)
                    total += np.sum(w * self(x[:, 0] - center[0]) * self(x[:, 1] - center[1]))
        return total


def polygon_area(polygon):
    """Area of a planar polygon (K by 2), of any orientation (the shoelace formula)."""
    if len(polygon) == 0:
        return 0.0
    x, y = polygon[:, 0], polygon[:, 1]
    return abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
