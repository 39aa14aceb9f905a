"""Small files that stand for much: each level names the one below twice, or names twice as many parts."""

from __future__ import annotations

import base64
import json
import zipfile

import numpy as np

import signedheat as sh


def three_mf(path, objects, items):
    build = "".join(f'<item objectid="{item}"/>' for item in items)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("3D/3dmodel.model", f"<model><resources>{objects}</resources><build>{build}</build></model>")


TRIANGLE = (
    '<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices>'
    '<triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>'
)


def doubled_3mf(path, levels):
    parts = "".join(
        f'<object id="{k}"><components>{2 * f"""<component objectid="{k - 1}"/>"""}</components></object>'
        for k in range(1, levels + 1)
    )
    three_mf(path, f'<object id="0">{TRIANGLE}</object>{parts}', [levels])


def doubled_svg(path, levels):
    groups = "".join(f'<g id="g{k}">{2 * f"""<use href="#g{k - 1}"/>"""}</g>' for k in range(1, levels + 1))
    path.write_text(f'<svg><defs><path id="g0" d="M0 0L1 1"/>{groups}</defs><use href="#g{levels}"/></svg>')


def used_curves(path, levels):
    curve = "M0 0" + "C1 1 2 1 3 0" * 300
    group = '<g id="b">' + '<use href="#a"/>' * 2**levels + "</g>"
    path.write_text(f'<svg><defs><path id="a" d="{curve}"/>{group}</defs>{2**levels * """<use href="#b"/>"""}</svg>')


def gltf(path, **parts):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype="<f4").tobytes()
    uri = f"data:application/octet-stream;base64,{base64.b64encode(points).decode()}"
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": uri, "byteLength": 48}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        **parts,
    }
    path.write_text(json.dumps(tree))


def shared_primitives(path, levels):
    n = 3000 * 2 ** (levels // 2)
    data = base64.b64encode(bytes(12 * n)).decode()
    gltf(
        path,
        buffers=[{"uri": f"data:,{data}", "byteLength": 12 * n}],
        bufferViews=[{"buffer": 0, "byteLength": 12 * n}],
        accessors=[{"bufferView": 0, "componentType": 5126, "count": n, "type": "VEC3"}],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}}] * 2**levels}],
    )


def own_buffers(path, levels):
    gltf(path, buffers=[{"uri": path.name, "byteLength": 9}] * 2**levels, meshes=[{"primitives": []}])


def shared_pieces(path, levels):
    n = 1000 * 2 ** (levels // 2)
    piece = (
        f'<Piece NumberOfPoints="{n}"><Points><DataArray type="Float64" format="appended" offset="0" '
        'NumberOfComponents="3"/></Points></Piece>'
    )
    head = f'<VTKFile type="PolyData" header_type="UInt64"><PolyData>{2**levels * piece}</PolyData>'
    data = np.array(24 * n, dtype="<u8").tobytes() + np.arange(3 * n, dtype="<f8").tobytes()
    path.write_bytes(head.encode() + b'<AppendedData encoding="raw">_' + data + b"</AppendedData></VTKFile>")


EXPANSIONS = {
    "components": ("a.3mf", doubled_3mf, sh.read, 26),
    "uses": ("a.svg", doubled_svg, sh.io.read_polylines, 40),
    "curves": ("a.svg", used_curves, sh.io.read_polylines, 6),
    "primitives": ("a.gltf", shared_primitives, sh.read, 12),
    "pieces": ("a.vtp", shared_pieces, sh.read, 13),
}
"""Files that double with each level, and the levels that are too many; half of them are read."""
