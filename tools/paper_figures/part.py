"""One run: a call of limn or of edge_benchmark, or a count of edges."""

from dataclasses import dataclass, field


@dataclass
class Part:
    name: str
    kind: str  # "compare", "gradient", "reject", "draws" or "edges"
    input: str  # scene; for the last three a mesh may stand here
    parameter: str = ""
    methods: list = field(default_factory=list)
    defines: dict = field(default_factory=dict)
    wide: bool = False  # four to three, not square
    small_mesh: str = ""  # NAME FACES of a mesh to make for it: the scene's $mesh, or the input
    needs: str = ""  # a file that may not be there
    options: list = field(default_factory=list)  # further arguments
