#!/usr/bin/env python3
"""How often `limn check` rejects a correct gradient: many small runs with correct gradients.

    tests/statistical/check_levels.py [--limn build/limn] [--runs 200] [--time S] [--keep FILE.json]

Scenes of its own (huge floors, long shapes, tiny emitters, gloss) and those of scenes/closed_form,
each with several parameters, every run with a seed and a number of samples, or a limit of time, of
its own. Prints the verdicts, and how p-values and the z-scores of the whole image are spread: a
level of 1e-4 shows nothing in 200 runs, but p < 0.05 must come in about 5 % of them or less. The
deviation of all windows' z should be 1 or less, also where gradients have few samples.
"""
import argparse
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def rectangle(name, size, angle, offset, inner):
    return (f'<shape type="rectangle" id="{name}"><transform name="to_world"><scale value="{size}"/>'
            f'<rotate x="1" angle="{angle}"/>{translate(offset)}</transform>{inner}</shape>')


def translate(offset):
    return '<translate x="{}" y="{}" z="{}"/>'.format(*offset)


def box(name, size, angle, offset, inner):
    scale = '<scale x="{}" y="{}" z="{}"/>'.format(*size)
    return (f'<shape type="cube" id="{name}"><transform name="to_world">{scale}'
            f'<rotate y="1" angle="{angle}"/>{translate(offset)}</transform>{inner}</shape>')


def ball(name, radius, center, inner):
    x, y, z = center
    return (f'<shape type="sphere" id="{name}"><float name="radius" value="{radius}"/>'
            f'<point name="center" value="{x},{y},{z}"/>{inner}</shape>')


def diffuse(name, colour):
    return f'<bsdf type="diffuse" id="{name}"><rgb name="reflectance" value="{colour}"/></bsdf>'


def gloss(name, alpha):
    return (f'<bsdf type="roughconductor" id="{name}"><string name="distribution" value="ggx"/>'
            f'<string name="material" value="none"/><float name="alpha" value="{alpha}"/></bsdf>')


def lamp(size, offset, radiance):
    light = f'<emitter type="area" id="glow"><rgb name="radiance" value="{radiance}"/></emitter>'
    return rectangle('lamp', size, 90, offset, light)


SKY = '<emitter type="constant" id="sky"><rgb name="radiance" value="0.3,0.4,0.5"/></emitter>'
CHALK = diffuse('chalk', '.8,.8,.8')
CLAY = diffuse('clay', '.6,.4,.3')


def scene(body, origin='1,2,4', target='0,0.3,0', size=16, depth=3):
    return f'''<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="{depth}"/>
<integer name="rr_depth" value="1000"/></integrator>
<sensor type="perspective"><string name="fov_axis" value="x"/><float name="fov" value="40"/>
<float name="near_clip" value="0.01"/><float name="far_clip" value="100000"/>
<transform name="to_world"><lookat origin="{origin}" target="{target}" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="{size}"/><integer name="height" value="{size}"/>
<string name="pixel_format" value="rgb"/><boolean name="sample_border" value="true"/>
<rfilter type="box"/></film></sensor>
{body}
</scene>
'''


def floor(half):
    return rectangle('floor', half, -90, (0, 0, 0), CHALK)


BOX = box('object', (.3, .2, .25), 27, (.1, .5, 0), CLAY)
OWN = [
    ('big_floor', scene(floor(1000) + BOX + lamp(.5, (.3, 2.5, .5), '6,6,6') + SKY),
     ['object.translate.x', 'object.rotate.y', 'sensor.translate.x', 'floor.translate.y']),
    ('huge_floor', scene(floor(20000) + box('object', (.03, .02, .025), 27, (.01, .05, 0), CLAY) +
                         lamp(.05, (.03, .25, .05), '6,6,6'), '.1,.2,.4', '0,.03,0'),
     ['object.translate.y', 'object.scale', 'sensor.translate.x', 'sensor.rotate.y']),
    ('long_box', scene(floor(3) + box('object', (60, .03, .05), 0, (0, .5, 0), CLAY) +
                       lamp(.4, (.3, 2.5, .5), '8,8,8')),
     ['object.translate.y', 'object.translate.z', 'object.rotate.y', 'lamp.translate.x']),
    ('tiny_lamp', scene(floor(3) + box('object', (.4, .3, .25), 27, (.1, .7, 0), CLAY) +
                        lamp(.005, (.3, 2.5, .5), '60000,60000,60000')),
     ['object.translate.x', 'object.translate.y', 'lamp.translate.x']),
    ('gloss', scene(rectangle('floor', 3, -90, (0, 0, 0), gloss('mirror', .1)) +
                    ball('object', .5, (.1, .8, 0), CLAY) + lamp(.4, (.3, 2.5, .5), '8,8,8') + SKY,
                    depth=4),
     ['object.translate.x', 'floor.rotate.x', 'mirror.alpha']),
    ('shiny_ball', scene(floor(3) + ball('object', .5, (.1, .8, 0), gloss('skin', .3)) +
                         lamp(.4, (.3, 2.5, .5), '8,8,8') + SKY),
     ['object.scale', 'object.rotate.x', 'object.translate.y', 'glow.radiance', 'sensor.fov']),
]


def write_scenes(folder):
    """(file, parameters) of every scene."""
    jobs = []
    for name, text, parameters in OWN:
        file = folder / f'{name}.xml'
        file.write_text(text)
        jobs.append((file, parameters))
    closed_form = ROOT / 'scenes' / 'closed_form'
    for entry in json.loads((closed_form / 'references.json').read_text())['scenes']:
        names = [p['name'] for p in entry['parameters'] if ':' not in p['name']][:3]
        if names:
            jobs.append((closed_form / entry['file'], names))
    return jobs


def run(limn, file, parameter, seed, samples, folder):
    figures = folder / 'check.json'
    figures.unlink(missing_ok=True)
    result = subprocess.run(
        [limn, 'check', file, '--wrt', parameter, '--seed', str(seed), *samples, '--quiet',
         '--json', figures], capture_output=True, text=True, cwd=file.parent, check=False)
    if not figures.exists():
        return {'status': result.returncode, 'error': result.stderr}
    return {'status': result.returncode, **json.loads(figures.read_text())[0]}


def report(rows):
    right = [r for r in rows if 'error' not in r]
    for r in rows:
        if 'error' in r:
            print('failed:', r['scene'], r['wrt'], r['error'])
    for name, status in (('agree', 0), ('cannot tell', 4), ('FALSE ALARMS', 1)):
        print(f'{name}: {sum(r["status"] == status for r in right)} of {len(right)}')
    for r in right:
        if r['status'] == 1:
            print('  rejected:', r['scene'], r['wrt'], 'seed', r['seed'], 'spp', r['spp'])
    for name, least, most in (('few', 0, 31), ('more', 32, 1e9)):
        z = [(r['windows']['count'], r['windows']['deviation'], r['windows']['mean']) for r in right
             if 'windows' in r and least <= r['spp'] <= most]
        if z:
            square = sum(n * (d * d + m * m) for n, d, m in z) / sum(n for n, _, _ in z)
            print(f'z of windows where gradients have {name} samples ({len(z)} runs): '
                  f'deviation {math.sqrt(square):.2f}')
    for name, values in (
            ('p', [r['p'] for r in right if 'p' in r]),
            ('p of the whole image', [math.erfc(abs(r['z_sum']) / math.sqrt(2)) for r in right])):
        if values:
            shares = ', '.join(f'{sum(v < x for v in values) / len(values):.3f} below {x}'
                               for x in (.5, .2, .1, .05, .02, .01))
            print(f'{name}: {shares}')


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument('--limn', default=str(ROOT / 'build' / 'limn'))
    options.add_argument('--runs', type=int, default=200)
    options.add_argument('--spp', type=int, nargs='+', default=[8, 16, 32, 64])
    options.add_argument('--time', type=float, help='seconds of each run, in place of --spp')
    options.add_argument('--keep', help='write every run to this file')
    arguments = options.parse_args()
    limn = os.path.abspath(arguments.limn)
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        jobs = [(f, p) for f, parameters in write_scenes(folder) for p in parameters]
        for k in range(arguments.runs):
            # All scenes in turn, with other seeds and samples in every round.
            file, parameter = jobs[k % len(jobs)]
            spp = arguments.spp[(k + k // len(jobs)) % len(arguments.spp)]
            samples = ['--time', str(arguments.time)] if arguments.time else ['--spp', str(spp)]
            rows.append({'scene': file.name, 'wrt': parameter, 'seed': k, 'spp': spp,
                         **run(limn, file, parameter, k, samples, folder)})
            if arguments.keep:
                pathlib.Path(arguments.keep).write_text(json.dumps(rows, indent=1))
            print(f'\r{k + 1} of {arguments.runs}', end='', file=sys.stderr, flush=True)
    print(file=sys.stderr)
    report(rows)


if __name__ == '__main__':
    main()
