"""Time from a USD file to a scene: 500 000 triangles in a few meshes or in many, and instances.

python benches/usd.py            print the table, a quarter of a minute
python benches/usd.py --tiny     run everything once on few triangles
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from meshes import room
from page import machine, table
from radarcore.adapters.usd import StageScene


def write_stage(path: Path, num_meshes: int, num_instances: int, num_triangles: int) -> None:
    """A stage with rooms of equal size, each instanced some times."""
    import numpy as np
    from pxr import Usd, UsdGeom, Vt

    stage = Usd.Stage.CreateNew(str(path))
    vertices, triangles = room(num_triangles // num_meshes)
    for k in range(num_meshes):
        prim = stage.CreateClassPrim(f"/_room{k}") if num_instances > 1 else stage.DefinePrim(f"/room{k}", "Xform")
        mesh = UsdGeom.Mesh.Define(stage, prim.GetPath().AppendChild("mesh"))
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(vertices.astype(np.float32)))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, dtype=np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.astype(np.int32).ravel()))
        for i in range(num_instances if num_instances > 1 else 0):
            placed = UsdGeom.Xform.Define(stage, f"/World/x{k}_{i}")
            placed.GetPrim().GetReferences().AddInternalReference(prim.GetPath())
            placed.GetPrim().SetInstanceable(True)
            placed.AddTranslateOp().Set((float(i), float(k), 0.0))
    stage.Save()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true", help="run everything once on few triangles")
    num_triangles = 2_000 if parser.parse_args().tiny else 500_000
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        sizes = ((1, 1), (50, 1), (1000, 1), (50, 20))
        for num_meshes, num_instances in sizes if num_triangles > 2_000 else ((1, 1), (2, 3)):
            path = Path(folder) / f"{num_meshes}x{num_instances}.usdc"
            write_stage(path, num_meshes, num_instances, num_triangles)
            start, processor = time.perf_counter(), time.process_time()
            scene = StageScene(path).scene
            times = time.perf_counter() - start, time.process_time() - processor
            rows.append([f"{num_meshes}", f"{num_instances}", f"{scene.num_triangles:,}", *(f"{t:.2f}" for t in times)])
    print(f"{machine()}\n")
    print(table(["meshes", "instances of each", "triangles of bodies", "time [s]", "processor time [s]"], rows))


if __name__ == "__main__":
    main()
