"""The program in place of Python: `python -m limn render ...`, and the command `limn` of a wheel."""

import os
import sys

from . import _processor


def main() -> None:
    if sys.argv[1:2] == ["reconstruct"]:  # it is written in Python
        from .reconstruction import main as reconstruct

        sys.exit(reconstruct(sys.argv[2:]))
    program = _processor.program()
    if not os.path.exists(program):
        sys.exit("limn: this build of the module holds no program: call build/limn")
    os.execv(program, ["limn", *sys.argv[1:]])


if __name__ == "__main__":
    main()
