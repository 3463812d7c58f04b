"""The reference of tools/docs: pages made from the program, the scenes and the docstrings."""

import ast
import glob
import os
import re
import subprocess
import tempfile
import xml.etree.ElementTree as ElementTree
from collections import defaultdict

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
LIMN = os.path.join(ROOT, "build", "limn")
MODULE = os.path.join(ROOT, "build", "python", "limn")


def limn(*arguments):
    return subprocess.check_output([LIMN, *arguments], cwd=ROOT, text=True,
                                   stderr=subprocess.DEVNULL).replace(LIMN, "limn")


def commands():
    """Names of the program's commands, as --help lists them."""
    return re.findall(r"^  (\w+)  +\S", limn("--help").split("Subcommands:")[1], re.MULTILINE)


def escaped(text):
    """Plain words as Markdown; code within backquotes stays, options become code."""
    return re.sub(r"(`[^`]*`)|(--[a-z][\w-]*)|([\\*_<>\[\]])",
                  lambda m: m[1] or (f"`{m[2]}`" if m[2] else "\\" + m[3]), text)


def help_page(text):
    """What --help prints, with a list in place of its columns, which narrow screens would cut."""
    lines, printed = [], text.strip().splitlines()
    for line, following in zip(printed, [*printed[1:], ""]):
        if line.lower().startswith("usage:"):
            lines += ["```text", line[7:], "```"]
        elif entry := re.match(r"  (\S.*?)(?:  +(.*))?$", line):
            name, words = entry[1], entry[2] or ""
            if not words and not following.startswith(" " * 30):  # the column begins right behind
                name, words = line[2:30].strip(), line[30:]
            lines.append(f"- `{name}`: {escaped(words)}".rstrip())
        elif line.startswith(" ") and lines[-1] == "```":  # a long usage goes on
            lines.insert(-1, line)
        elif line.startswith(" "):
            lines[-1] += " " + escaped(line.strip())
        else:
            lines.append(f"\n**{line}**\n" if line.endswith(":") else escaped(line))
    return "\n".join(lines) + "\n"


def commands_page():
    lines = ["# Commands\n", help_page(limn("--help"))]
    for command in commands():
        lines += [f"## {command}\n", help_page(limn(command, "--help"))]
    return "\n".join(lines)


def cells(*texts):
    return "| " + " | ".join(t.replace("|", "\\|") for t in texts) + " |"


def methods_page():
    """`limn methods --all`: columns of a fixed width, settings indented."""
    header, *rows = limn("methods", "--all").rstrip().splitlines()
    starts = [match.start() for match in re.finditer(r"\S+( \S+)*", header)]
    columns = [*zip(starts, [*starts[1:], None])]
    table, settings = [], []
    for row in rows:
        if row.startswith(" "):
            setting, what = re.split(r"  +", row.strip(), maxsplit=1)
            settings.append(cells(f"`{setting}`", what))
        else:
            fields = [row[a:b].strip() for a, b in columns]
            table.append(cells(f"`{fields[0]}`", *fields[1:]))
            settings.append(f"\n## {fields[0]}\n\n{fields[-1]}\n\n| setting | meaning |\n|---|---|")
    titles = [header[a:b].strip() for a, b in columns]
    text = "\n".join(["# Methods\n", cells(*titles), cells(*["---"] * len(titles)), *table,
                      "\nAppend settings to a name, as in `forest:width=4:look-ahead=none`; the "
                      "first value is the default.\n", *settings]) + "\n"
    # Methods without settings have no table.
    return re.sub(r"\n## [^\n]*\n\n[^\n]*\n\n\| setting \| meaning \|\n\|---\|---\|(?!\n\|)", "", text)


MAP = '<texture name="NAME" type="bitmap"><string name="filename" value="map.hdr"/>' \
      '<boolean name="raw" value="true"/></texture>'
NESTED = '<bsdf type="diffuse" id="nested_ID"/>'
UNEVEN = '<float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.2"/>'
# Parameters that exclude others of a type: further elements.
OTHERS = {"roughconductor": UNEVEN, "roughdielectric": UNEVEN,
          "principled": '<float name="eta" value="1.5"/>'}
# The elements that a type cannot do without, or that have parameters only where they are given.
INSIDE = {
    "bsdf": {"blendbsdf": '<float name="weight" value="0.5"/>' + NESTED + NESTED.replace("_", "_2_"),
             "bumpmap": MAP + NESTED, "mask": '<float name="opacity" value="0.5"/>' + NESTED,
             "normalmap": MAP.replace("NAME", "normalmap") + NESTED, "twosided": NESTED,
             "principled": "".join(f'<float name="{name}" value="0.5"/>'
                                   for name in ("anisotropic", "metallic", "spec_trans", "clearcoat")),
             "principledthin": '<float name="anisotropic" value="0.5"/>'},
    "emitter": {"envmap": '<string name="filename" value="map.hdr"/>',
                "projector": MAP.replace("NAME", "irradiance")},
}


def types(tag):
    """All that the reader knows (tests hold load_dict's list to it)."""
    with open(os.path.join(MODULE, "dicts.py"), encoding="utf-8") as stream:
        text = re.search(r"^TYPES = (\{.*?^\})", stream.read(), re.MULTILINE | re.DOTALL)[1]
    return ast.literal_eval(text)[tag]


def example(folder):
    """A scene with one of each BSDF and emitter that has its type for its id; its file. Of the
    environments it has one: scenes here have the constant one."""

    def element(tag, name):
        inside = INSIDE[tag].get(name, "").replace("ID", name).replace(' name="NAME"', "")
        return f'<{tag} type="{name}" id="{name}">{inside}</{tag}>'

    on_shapes = [element("bsdf", name) for name in types("bsdf")] + [element("emitter", "area")]
    on_shapes += [f'<bsdf type="{name}" id="other_{name}">{inside}</bsdf>'
                  for name, inside in OTHERS.items()]
    free = [element("emitter", name) for name in types("emitter") if name not in ("area", "constant")]
    lines = ['<scene version="3.0.0">', '<sensor type="perspective"/>', *free,
             *(f'<shape type="rectangle">{inside}</shape>' for inside in on_shapes), "</scene>"]
    with open(os.path.join(folder, "map.hdr"), "wb") as stream:  # 2 x 4 grey pixels
        stream.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 2\n" + bytes([128, 128, 128, 128]) * 8)
    file = os.path.join(folder, "example.xml")
    with open(file, "w", encoding="utf-8") as stream:
        stream.write("\n".join(lines))
    return file


def add_parameters(file, found):
    """Those that `limn info` lists of a scene, by kind of object; found[kind][name] is the unit."""
    try:
        listed = limn("info", file)
    except subprocess.CalledProcessError:
        return  # a part that others include
    kinds = {"sensor": "sensor"}
    for element in ElementTree.parse(file).iter():
        if element.get("id") and element.get("type"):
            kinds[element.get("id")] = f"{element.tag} {element.get('type')}"
    for name, unit in re.findall(r"^  (\S+)  \[(.*?)\]", listed, re.MULTILINE):
        thing, _, rest = name.partition(".")
        kind = kinds.get(thing, "").replace("sensor perspective", "sensor")
        if kind.startswith("shape"):
            kind = "shape"
        if kind:
            found[kind].setdefault(re.sub(r"\.[xyz]$", ".x", rest), unit)


def parameters_page():
    """What `limn info` lists of all scenes here and of one with all types."""
    found = defaultdict(dict)
    for file in sorted(glob.glob(os.path.join(ROOT, "scenes", "**", "*.xml"), recursive=True)):
        add_parameters(file, found)
    with tempfile.TemporaryDirectory(prefix="limn_reference_") as folder:
        add_parameters(example(folder), found)
    lines = ["# Parameters\n",
             "`ID.NAME`, for `--wrt` and `scene[...]`; `limn info SCENE` lists those of a scene. "
             "Where `.x` stands, `.y` and `.z` exist. Where a texture gives a colour or number, "
             "`NAME.data` (`bitmap`), `NAME.color0` and `NAME.color1` (`checkerboard`), or "
             "`SHAPE.ATTRIBUTE` (`mesh_attribute`) stand for it. Materials around another one have "
             "that one's, too.\n",
             "| object | parameter | unit |", "|---|---|---|"]
    for kind in sorted(found):
        for unit in sorted(set(found[kind].values())):
            names = ", ".join(f"`{n}`" for n in sorted(found[kind]) if found[kind][n] == unit)
            lines.append(cells(kind, names, unit))
    return "\n".join(lines) + "\n"


def signature(node):
    """As it is called: arguments one a line where they are many."""
    text = f"{node.name}({ast.unparse(node.args)})"
    if node.returns is not None:
        text += f" -> {ast.unparse(node.returns)}"
    text = re.sub(r"\bself, |\bself\b", "", text)
    text = text.replace("numpy.typing.", "").replace("collections.abc.", "").replace("_typing.", "")
    if len(text) > 90:
        text = re.sub(r", (?=\*|\w+: )", ",\n    ", text.replace("(", "(\n    ", 1))
    return text


def documentation(node):
    """The docstring as Markdown: indented examples stay code, arguments make a list."""
    return re.sub(r"^(\w+): ", r"- `\1`: ", ast.get_docstring(node) or "", flags=re.MULTILINE)


def entry(node, level, owner=""):
    if isinstance(node, ast.ClassDef):
        lines = [f"{'#' * level} {owner}{node.name}\n", documentation(node), ""]
        # Overloads and what numbers do by themselves are left to the stub.
        for member in node.body:
            if isinstance(member, ast.FunctionDef) and (not member.name.startswith("_")
                                                        or member.name == "__init__"):
                lines += member_entry(member)
        return lines
    return [f"{'#' * level} {owner}{node.name}\n", "```python", signature(node), "```\n",
            documentation(node), ""]


def member_entry(member):
    decorators = [ast.unparse(d) for d in member.decorator_list]
    if any(d.endswith("setter") for d in decorators):
        return []
    text = " ".join(documentation(member).split())
    if "property" in decorators:
        return [f"- `.{member.name}`: {text}"]
    if member.name == "__init__":
        return ["```python", signature(member), "```\n", documentation(member), ""] if text else []
    return [f"- `.{' '.join(signature(member).split())}`: {text}"]


def definitions(file):
    with open(os.path.join(MODULE, file), encoding="utf-8") as stream:
        body = ast.parse(stream.read()).body
    return {n.name: n for n in body if isinstance(n, (ast.FunctionDef, ast.ClassDef))}


def exported(file):
    with open(os.path.join(MODULE, file), encoding="utf-8") as stream:
        return re.findall(r'"(\w+)"', re.search(r"__all__ = \[(.*?)\]", stream.read(), re.DOTALL)[1])


def python_page():
    """All of limn.__all__, from the stub and the sources; PyTorch and JAX need not be there."""
    known = {}
    for file in ["_limn.pyi", *sorted(f for f in os.listdir(MODULE) if f.endswith(".py"))]:
        if file not in ("torch.py", "jax.py"):
            known = {**definitions(file), **known}
    lines = ["# Python\n", "`import limn`. An introduction: [limn from "
             "Python](../tools/python/README.md).\n"]
    names = exported("__init__.py")
    for title, kind in (("Functions", ast.FunctionDef), ("Classes", ast.ClassDef)):
        lines.append(f"## {title}\n")
        for name in names:
            if isinstance(known[name], kind):
                lines += entry(known[name], 3)
    for bridge in ("torch", "jax"):
        lines.append(f"## limn.{bridge}\n")
        there = definitions(f"{bridge}.py")
        for name in exported(f"{bridge}.py"):
            lines += entry(there[name], 3, f"{bridge}.")
    return "\n".join(lines) + "\n"


def write(folder):
    os.makedirs(folder, exist_ok=True)
    for name, page in (("commands", commands_page), ("methods", methods_page),
                       ("parameters", parameters_page), ("python", python_page)):
        with open(os.path.join(folder, f"{name}.md"), "w", encoding="utf-8") as stream:
            stream.write(page())
