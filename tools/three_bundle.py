"""Make the library that draws the page in three dimensions, `tripod_view/web/three.js`, from the packages of three.js.

    python -m tools.three_bundle

Needs npm and a network. The parts of three.js (MIT) that `view.js` and the live page use become one file, minified by
esbuild; it defines the object THREE. Its licence is written beside it. Both versions are pinned here.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

THREE, ESBUILD = "0.187.0", "0.28.2"
WEB = Path(__file__).parents[1] / "tripod_view" / "web"

PARTS = (
    "BufferAttribute", "BufferGeometry", "Color", "ColorManagement", "ConeGeometry", "CylinderGeometry",
    "DirectionalLight", "DoubleSide", "DynamicDrawUsage", "EdgesGeometry", "EqualStencilFunc", "Group",
    "HemisphereLight", "IncrementStencilOp", "InstancedMesh", "Line", "LinearSRGBColorSpace",
    "LineBasicMaterial", "LineSegments", "Matrix4", "Mesh", "MeshBasicMaterial", "MeshLambertMaterial",
    "PerspectiveCamera", "Quaternion", "Raycaster", "Scene", "Sphere", "Box3", "Vector2", "Vector3",
    "WebGLRenderer",
)  # fmt: skip
"""Of the package `three`."""

ADDONS = {"OrbitControls": "controls/OrbitControls.js", "TransformControls": "controls/TransformControls.js"}
"""Of its folder addons."""


def main() -> int:
    """Write the file and its licence; return the exit code."""
    lines = [f'export {{ {", ".join(PARTS)} }} from "three";']
    lines += [f'export {{ {name} }} from "three/addons/{path}";' for name, path in ADDONS.items()]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        needed = {"three": THREE, "esbuild": ESBUILD}
        (folder / "package.json").write_text(
            json.dumps({"private": True, "dependencies": needed}), encoding="utf-8"
        )
        (folder / "entry.js").write_text("\n".join(lines), encoding="utf-8")
        out = [
            "--bundle",
            "--minify",
            "--format=iife",
            "--global-name=THREE",
            "--legal-comments=none",
            "--outfile=three.js",
        ]
        banner = f"--banner:js=/* three.js {THREE}, MIT: three.LICENSE */"
        try:
            subprocess.run(["npm", "install", "--silent", "--no-audit"], cwd=folder, check=True)
            subprocess.run(["npx", "esbuild", "entry.js", *out, banner], cwd=folder, check=True)
        except (OSError, subprocess.CalledProcessError) as error:
            print(f"three_bundle: {error}; npm and a network are needed", file=sys.stderr)
            return 1
        (WEB / "three.js").write_bytes((folder / "three.js").read_bytes())
        (WEB / "three.LICENSE").write_bytes((folder / "node_modules" / "three" / "LICENSE").read_bytes())
    print(f"{WEB / 'three.js'}: {(WEB / 'three.js').stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
