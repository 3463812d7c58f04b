"""The bias of warped-area sampling over its rays, as a table and a chart."""

import math
import os

from report.markup import Markup, element, figures, join, table
from report.records import read_record

WIDTH, HEIGHT, LEFT, BOTTOM, MARGIN = 520, 300, 64, 44, 16


def _axis(values):
    """Whole powers of ten around the values."""
    low, high = math.log10(min(values)), math.log10(max(values))
    return math.floor(low - 0.05), math.ceil(high + 0.05)


def _text(x, y, words, anchor="middle", turn=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{turn}>{words}</text>'


def _line(x0, y0, x1, y1, style):
    return f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" {style}/>'


def _chart(points):
    """points: (rays, relative bias, its standard error), the biases positive. SVG without script."""
    low, high = _axis([bias for _, bias, _ in points])
    first, last = math.log2(points[0][0]) - 0.5, math.log2(points[-1][0]) + 0.5

    def x(rays):
        share = (math.log2(rays) - first) / (last - first)
        return LEFT + share * (WIDTH - LEFT - MARGIN)

    def y(bias):
        share = (math.log10(max(bias, 10.0**low)) - low) / (high - low)
        return HEIGHT - BOTTOM - share * (HEIGHT - BOTTOM - MARGIN)

    grid, ink = 'stroke="var(--grid)"', 'stroke="var(--link)" stroke-width="2"'
    pieces = []
    for power in range(low, high + 1):
        height = y(10.0**power)
        pieces.append(_line(LEFT, height, WIDTH - MARGIN, height, grid))
        pieces.append(_text(LEFT - 6, height + 4, f"{100 * 10.0 ** power:g} %", "end"))
    for rays, bias, error in points:
        pieces.append(_text(x(rays), HEIGHT - BOTTOM + 18, rays))
        pieces.append(_line(x(rays), y(bias - 2 * error), x(rays), y(bias + 2 * error), ink))
        pieces.append(f'<circle cx="{x(rays):.1f}" cy="{y(bias):.1f}" r="4" fill="var(--link)"/>')
    for (rays, bias, _), (next_rays, next_bias, _) in zip(points, points[1:]):
        pieces.append(_line(x(rays), y(bias), x(next_rays), y(next_bias), ink))
    middle = (HEIGHT - BOTTOM) / 2
    pieces.append(_text((LEFT + WIDTH) / 2, HEIGHT - 8, "auxiliary rays"))
    pieces.append(_text(14, middle, "bias of was",
                        turn=f' transform="rotate(-90 14 {middle:.1f})"'))
    style = "max-width:560px;font-size:12px;fill:currentColor"
    return Markup(f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" style="{style}" role="img" aria-label="bias over rays">'
                  + "".join(pieces) + "</svg>")


def _read(part, folder):
    """(method, rays, sum over the image, its standard error), or None where it was not run."""
    file = os.path.join(folder(part), "gradient.json")
    if not os.path.exists(file):
        return None
    record = read_record(file)
    (parameter,) = record.records("parameters")
    settings = record.record("settings")
    rays = int(settings.number("auxiliary rays")) if settings.has("auxiliary rays") else None
    return record.text("method"), rays, parameter.number("sum"), parameter.number("sum_stderr")


def html(parts, folder):
    """What `was` says beyond the first part, whose method has no bias; None without that or without a run."""
    runs = [_read(part, folder) for part in parts if part.kind == "gradient"]
    if not runs or runs[0] is None or len(runs) < 2:
        return None
    name, _, truth, truth_error = runs[0]
    rows, points = [[name, "–", figures(truth), "–", "–"]], []
    for run in filter(None, runs[1:]):
        method, rays, total, error = run
        both = math.hypot(error, truth_error)
        bias, spread = total / truth - 1, both / abs(truth)
        rows.append([method, str(rays), figures(total), f"{100 * bias:.2g} ± {100 * spread:.1g} %",
                     figures((total - truth) / both)])
        if method == "was" and bias > 0:
            points.append((rays, bias, spread))
    head = ["method", "rays", "derivative, all pixels", "bias", "in standard errors"]
    words = "A lamp of two triangles over a plane, moved sideways; bars are two standard errors."
    return join(element("h3", "Bias over rays"), element("p", words),
                element("div", _chart(points), class_="chart") if len(points) > 1 else None,
                table(head, rows, "Bias of warped-area sampling"))
