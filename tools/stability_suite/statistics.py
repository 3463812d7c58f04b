"""Figures of one method at one point: bias, error, tail. Images are H by W, in units of the
derivative; means and sums run over pixels.

The reference is independent of the runs and noisy itself: its variance is taken off the squared
error, and added to that of a difference where a bias is looked for.
"""

import math
from dataclasses import dataclass

import numpy as np

BLOCKS = 6  # along each side of the film
# A bias is called where its p is below this twice: in the runs, and in as many new ones, longer.
# One false alarm in a hundred pages of a thousand tests.
LEVEL = 1e-5
WORST = 0.001  # the share of pixels whose part in the squared error is the tail


@dataclass
class Estimate:
    """mean and the variance of it, pixel by pixel."""

    mean: np.ndarray
    variance: np.ndarray

    def times(self, factor):
        return Estimate(factor * self.mean, factor**2 * self.variance)


def normal_tail(z):
    """Of both sides."""
    return math.erfc(abs(z) / math.sqrt(2))


def chi_square_tail(value, degrees):
    """Wilson and Hilferty's approximation; above 20 degrees right to 1e-3 of itself at p = 1e-3."""
    c = 2 / (9 * degrees)
    z = ((value / degrees) ** (1 / 3) - (1 - c)) / math.sqrt(c)
    return 0.5 * math.erfc(z / math.sqrt(2))


def blocks(image):
    """Sums over BLOCKS by BLOCKS blocks, as a list."""
    rows = np.array_split(np.arange(image.shape[0]), BLOCKS)
    columns = np.array_split(np.arange(image.shape[1]), BLOCKS)
    return np.array([image[np.ix_(r, c)].sum() for r in rows for c in columns])


def block_variances(estimate, magnitude):
    """Of the sums over blocks. A block that rare samples have not met yet shows no variance: where
    edges add m to the image by events of mean size s, they do so with a variance of m s, and s is
    known from the image as a whole.
    magnitude: absolute values of the derivative, pixel by pixel."""
    own = blocks(estimate.variance)
    whole = magnitude.sum()
    size = estimate.variance.sum() / whole if whole > 0 else 0
    return np.maximum(own, size * blocks(magnitude))


def pooled(runs):
    """The mean of independent runs. Their variances are raised where the runs differ by more."""
    mean = np.mean([r.mean for r in runs], axis=0)
    variance = np.sum([r.variance for r in runs], axis=0) / len(runs) ** 2
    if len(runs) > 1 and variance.sum() > 0:
        spread = np.sum([(r.mean - mean) ** 2 for r in runs]) / (len(runs) * (len(runs) - 1))
        variance = variance * max(1.0, spread / variance.sum())
    return Estimate(mean, variance)


def bias(runs, reference):
    """z-scores of the blocks of the mean over the runs against the reference, and what they say:
    p, the largest |z|, the share of the derivative that is too much (negative: missing), and
    the least such share that would have been called."""
    whole = pooled(runs)
    truth = np.abs(reference.mean)
    # What the runs have met and the reference has not, it may have missed.
    variance = block_variances(whole, truth) + block_variances(
        reference, np.maximum(truth, np.abs(whole.mean)))
    difference = blocks(whole.mean - reference.mean)
    known = variance > 0
    if not known.any():
        return {"p": None, "chi_square": 0, "blocks": 0, "largest_z": None, "share": None,
                "visible": None, "scores": []}
    z = difference[known] / np.sqrt(variance[known])
    strength = blocks(reference.mean)[known] / np.sqrt(variance[known])
    n = len(z)
    p_all = chi_square_tail(float((z**2).sum()), n)
    p_largest = -math.expm1(n * math.log1p(-min(normal_tail(np.abs(z).max()), 1 - 1e-16)))
    squares = float((strength**2).sum())
    return {
        "p": min(1.0, 2 * min(p_all, p_largest)),
        "chi_square": float((z**2).sum()),
        "blocks": n,
        "largest_z": float(np.abs(z).max()),
        "share": float((strength * z).sum() / squares) if squares > 0 else None,
        "visible": least_visible(n, squares),
        "scores": [round(float(v), 3) for v in z],
    }


def called(bias):
    return bias is not None and bias["p"] is not None and bias["p"] < LEVEL


def confirmed(first, longer):
    """Whether a bias that was called shows in longer runs, too, and no weaker than chance allows.
    What rare samples that were not met pretend fades with time."""
    if not (called(first) and called(longer)):
        return False
    chance = math.sqrt(2 * first["blocks"] + 4 * first["chi_square"])
    return longer["chi_square"] > first["chi_square"] - 3 * chance


def least_visible(count, squares):
    """The relative error of the whole derivative at which the expected sum of squared scores has a
    p of LEVEL. squares: of the derivative of each block over its standard error."""
    if squares <= 0:
        return None
    low, high = 0.0, 1.0
    while 2 * chi_square_tail(count + high, count) > LEVEL:
        high *= 2
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if 2 * chi_square_tail(count + middle, count) > LEVEL else (
            low, middle)
    return math.sqrt(high / squares)


def errors(runs, reference):
    """Root of the mean squared error of one run over that of the derivative, and the tail.

    The spread of the runs needs no reference. What their mean misses beyond it is counted where it
    is more than the reference's own noise can explain (by three standard errors).
    """
    power = float((reference.mean**2 - reference.variance).mean())
    differences = np.array([r.mean - reference.mean for r in runs])
    squares = differences**2
    whole = float((squares - reference.variance).mean())
    spread = float(pooled(runs).variance.mean()) * len(runs)
    # Of the mean of (run - reference)^2, as far as the reference's noise goes.
    d = np.mean(differences, axis=0)
    noise = math.sqrt(float((4 * d**2 * reference.variance).sum()) +
                      2 * float((reference.variance**2).sum())) / d.size
    mse = whole if whole > spread + 3 * noise else max(spread, 0.0)
    count = max(1, round(WORST * squares.size))
    total = float(squares.sum())
    worst = float(np.sort(squares, axis=None)[-count:].sum())
    return {
        "error": math.sqrt(mse / power) if power > 0 else None,
        "tail": worst / total if total > 0 else 0.0,
    }


def own_error(reference):
    """Of a reference, relative to the derivative; None if it is all noise."""
    power = float((reference.mean**2 - reference.variance).mean())
    return math.sqrt(float(reference.variance.mean()) / power) if power > 0 else None
