"""Does the radar see a robot cell with a skinned person alike, as a USD stage and as radarcore's own bodies?

The stage is written as other programs write theirs: centimetres, y up, 120 time samples per second of the links of an
arm, and a person who is one mesh with a skeleton (extra `usd`). Vary the rate, the speed of the person, the arm.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import radarcore as rc
from radarcore.adapters.usd import StageScene

radar = rc.Radar(rc.bgt60tr13c().waveform)
mount = rc.Pose([0.0, 0.0, 1.0])
person = rc.models.Human(height=1.75, speed=1.2, path=[[4.5, 0.6], [1.0, 0.0]])
turns = np.deg2rad([[90.0, -70.0, 90.0, -20.0, 90.0, 0.0], [140.0, -50.0, 70.0, -20.0, 90.0, 0.0]])
arm = rc.models.RobotArm.ur10().moving(rc.models.JointTrajectory([0.0, 1.5], turns), base=rc.Pose([2.2, -1.2, 0.6]))
segments, links = person.bodies(name="person"), arm.bodies(name="arm")


def write_stage(path: Path, times: np.ndarray) -> None:
    """Write the scene as a stage; the material of the person has a name of the library."""
    from pxr import Usd, UsdGeom, UsdShade, UsdSkel

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetTimeCodesPerSecond(1.0)
    UsdGeom.Xform.Define(stage, "/World").AddRotateXOp().Set(-90.0)  # from z up
    for link in links:
        mesh = add_mesh(UsdGeom.Mesh.Define(stage, f"/World/{link.name}"), link.mesh.vertices, link.mesh.triangles)
        shift, turn = mesh.AddTranslateOp(), mesh.AddOrientOp()
        for time, (shifted, turned) in zip(times.tolist(), values(link.motion, times), strict=True):
            shift.Set(shifted, time)
            turn.Set(turned, time)

    # A joint per segment; the mesh is all segments as they stand at the first time.
    UsdSkel.Root.Define(stage, "/World/person")
    skeleton = UsdSkel.Skeleton.Define(stage, "/World/person/skeleton")
    animation = UsdSkel.Animation.Define(stage, "/World/person/skeleton/walk")
    names = [str(segment.name).replace("person/", "") for segment in segments]
    samples = [values(segment.motion, times) for segment in segments]
    for joints in (skeleton.CreateJointsAttr(), animation.CreateJointsAttr()):
        joints.Set(names)
    shifts, rotations = animation.CreateTranslationsAttr(), animation.CreateRotationsAttr()
    animation.CreateScalesAttr([(1.0, 1.0, 1.0)] * len(names))
    for k, time in enumerate(times.tolist()):
        shifts.Set([each[k][0] for each in samples], time)
        rotations.Set([each[k][1] for each in samples], time)
    binds = UsdSkel.MakeTransforms(shifts.Get(times[0]), rotations.Get(times[0]), animation.GetScalesAttr().Get())
    skeleton.CreateBindTransformsAttr(binds)
    skeleton.CreateRestTransformsAttr(binds)
    starts = np.cumsum([0, *(len(segment.mesh.vertices) for segment in segments)])
    vertices = [segment.motion.at(times[0]).apply(segment.mesh.vertices) for segment in segments]
    triangles = [segment.mesh.triangles + start for segment, start in zip(segments, starts, strict=False)]
    skin = add_mesh(
        UsdGeom.Mesh.Define(stage, "/World/person/body"), np.concatenate(vertices), np.concatenate(triangles)
    )
    binding = UsdSkel.BindingAPI.Apply(skin.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    binding.CreateJointIndicesPrimvar(False, 1).Set(np.repeat(np.arange(len(segments)), np.diff(starts)).tolist())
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * int(starts[-1]))
    UsdShade.MaterialBindingAPI.Apply(skin.GetPrim()).Bind(UsdShade.Material.Define(stage, "/Looks/Skin"))
    stage.Save()


def values(motion: Any, times: np.ndarray) -> list[tuple[Any, Any]]:
    """Translations [cm] and rotations of a motion, as USD has them."""
    from pxr import Gf

    poses = [motion.at(time) for time in times.tolist()]
    quaternions = [Rotation.from_matrix(pose.rotation).as_quat(scalar_first=True).tolist() for pose in poses]
    return [(Gf.Vec3f(*(100.0 * pose.position)), Gf.Quatf(*q)) for pose, q in zip(poses, quaternions, strict=True)]


def add_mesh(mesh: Any, vertices: np.ndarray, triangles: np.ndarray) -> Any:
    from pxr import Vt

    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy((100.0 * vertices).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([3] * len(triangles))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.astype(np.int32).ravel()))
    return mesh


def main(path: Path, num_frames: int, rate: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    write_stage(path, np.arange(0.0, 1.5 + 1.0 / rate, 1.0 / rate))
    stage = StageScene(path, interpolation="cubic")
    scenes = {"bodies": rc.Scene([*links, *segments]), "stage": stage.scene}
    simulators = {name: rc.Simulator(scene, radar, radar_motion=mount) for name, scene in scenes.items()}
    differences = []
    for time in np.linspace(0.1, 1.3, num_frames).tolist():
        frames = {name: simulator.frame(time) for name, simulator in simulators.items()}
        rows = {name: seen(frame) for name, frame in frames.items()}
        for name, (person_range, person_velocity, arm_range, arm_velocity, *echo) in rows.items():
            print(
                f"{time:.1f} s, {name}: person {person_range:.4f} m, {person_velocity:+.3f} m/s; "
                f"arm {arm_range:.4f} m, {arm_velocity:+.3f} m/s; strongest echo {echo[0]:.3f} m, {echo[1]:+.3f} m/s"
            )
        cubes = frames["stage"].cube, frames["bodies"].cube
        share = np.linalg.norm(cubes[0] - cubes[1]) / np.linalg.norm(cubes[1])
        differences.append([*np.abs(np.subtract(rows["stage"], rows["bodies"])), share])
    largest = np.max(differences, axis=0)
    print(
        f"largest differences: {1e3 * largest[[0, 2, 4]].max():.2f} mm, {1e3 * largest[[1, 3, 5]].max():.2f} mm/s, "
        f"{100.0 * largest[6]:.2g} % of the samples (rms)"
    )


def seen(frame: rc.Frame) -> list[float]:
    """True range [m] and velocity [m/s] of the nearest part of the person and of the arm, and of the strongest echo."""
    found = []
    for name in ("person", "arm"):
        parts = [k for k, part in enumerate(frame.truth.names) if f"{name}/" in part]
        nearest = parts[int(np.nanargmin(frame.truth.range[parts]))]
        found += [float(frame.truth.range[nearest]), float(frame.truth.velocity[nearest])]
    peak = rc.strongest_peak(frame)
    return [*found, peak.range, peak.velocity]


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--path", type=Path, default=Path("out/usd_cell.usdc"))
    options.add_argument("--num-frames", type=int, default=4)
    options.add_argument("--rate", type=float, default=120.0, help="time samples per second")
    main(**vars(options.parse_args()))
