"""Packs the Python package with a built extension module into a wheel for this machine's Linux, and prints its path.

    python module-wheel.py MODULE FOLDER

Tests install it. What a wheel for a release promises of Pythons and systems, this one does not.
"""

import base64
import hashlib
import re
import shutil
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
module, folder = map(Path, sys.argv[1:])
project = tomllib.loads((ROOT / "python/pyproject.toml").read_text())["project"]
version = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
tag = f"cp310-abi3-{re.sub('[-.]', '_', sysconfig.get_platform())}"

sources = sorted((ROOT / "python/edgepuck").glob("*.py*"))
files = {f"edgepuck/{file.name}": file.read_bytes() for file in sources if file.is_file()}
files["edgepuck/py.typed"] = b""
files["edgepuck/_edgepuck.abi3.so"] = module.read_bytes()
needs = "".join(f"Requires-Dist: {package}\n" for package in project["dependencies"])
scripts = "".join(f"{name} = {function}\n" for name, function in project["scripts"].items())
texts = {
    "METADATA": f"Metadata-Version: 2.1\nName: edgepuck\nVersion: {version}\n{needs}",
    "WHEEL": f"Wheel-Version: 1.0\nGenerator: edgepuck\nRoot-Is-Purelib: false\nTag: {tag}\n",
    "entry_points.txt": f"[console_scripts]\n{scripts}",
}
info = f"edgepuck-{version}.dist-info"
files |= {f"{info}/{name}": text.encode() for name, text in texts.items()}

shutil.rmtree(folder, ignore_errors=True)
folder.mkdir(parents=True)
wheel = folder / f"edgepuck-{version}-{tag}.whl"
with zipfile.ZipFile(wheel, "w") as archive:
    record = ""
    for name, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip("=")
        record += f"{name},sha256={digest},{len(content)}\n"
        archive.writestr(name, content)
    archive.writestr(f"{info}/RECORD", f"{record}{info}/RECORD,,\n")
print(wheel)
