"""The Python that runs a page's script."""

import importlib.util
import os
import sys

SYSTEM_PYTHON = "/usr/bin/python3"  # where Debian's matplotlib is, when another python3 comes first


def use_one_with_matplotlib():
    """Starts the script anew under the system's Python where this one lacks matplotlib or numpy."""
    started_anew = os.environ.pop("LIMN_REPORT_PYTHON", None)  # scripts that it starts ask again
    if all(importlib.util.find_spec(name) for name in ("matplotlib", "numpy")):
        return
    if not started_anew and os.access(SYSTEM_PYTHON, os.X_OK):
        os.environ["LIMN_REPORT_PYTHON"] = SYSTEM_PYTHON
        os.execv(SYSTEM_PYTHON, [SYSTEM_PYTHON, os.path.abspath(sys.argv[0]), *sys.argv[1:]])
