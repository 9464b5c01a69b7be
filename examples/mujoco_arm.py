"""How far and how fast is a box that slides past a swinging arm, in a live MuJoCo simulation? (extra `mujoco`)

python examples/mujoco_arm.py
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

import radarcore as rc
from radarcore.adapters.mujoco import LiveModel, frames

WORLD = """
<mujoco>
  <option timestep="0.0025"/>
  <asset><material name="concrete"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" material="concrete"/>
    <body name="stand" pos="-0.1 0 0.9">
      <geom name="housing" type="box" size="0.03 0.05 0.05"/>
      <camera name="radar" pos="0.1 0 0" xyaxes="0 -1 0 0 0 1"/>
    </body>
    <body name="upper arm" pos="2.6 0.9 0.6">
      <joint name="shoulder" axis="0 0 1" damping="5"/>
      <geom type="capsule" fromto="0 0 0 0 -0.5 0.1" size="0.06" mass="5"/>
      <body name="forearm" pos="0 -0.5 0.1">
        <joint name="elbow" axis="0 0 1" damping="2"/>
        <geom type="capsule" fromto="0 0 0 0 -0.4 0" size="0.05" mass="3"/>
      </body>
    </body>
    <body name="box" pos="2.4 -0.5 0.9">
      <joint name="rail" type="slide" axis="-1 0 0"/>
      <geom type="box" size="0.1 0.1 0.1" mass="10"/>
    </body>
  </worldbody>
  <actuator>
    <position joint="shoulder" kp="60"/>
    <position joint="elbow" kp="30"/>
    <velocity joint="rail" kv="400"/>
  </actuator>
</mujoco>
"""


def control(data: Any) -> None:
    """Swing the arm, push the box at 0.8 m/s."""
    data.ctrl[:] = 0.5 * np.sin(6.0 * data.time), 0.8 * np.sin(4.0 * data.time), 0.8


def main() -> None:
    model = mujoco.MjModel.from_xml_string(WORLD)
    data = mujoco.MjData(model)
    live = LiveModel(model, skip=("housing",), materials={"forearm": "pla"})
    radar = rc.bgt60tr13c(num_chirps=64, num_samples=128)
    simulator = rc.Simulator(live.scene, radar, radar_motion=live.motion(camera="radar"))
    box = live.scene.names.index("box/box")
    for frame in frames(simulator, live, data, rate=20.0, duration=0.3, control=control):
        truth = frame.truth
        peak = rc.strongest_peak(frame, max_velocity=-0.5)
        found = "nothing" if peak is None else f"{peak.range:.2f} m, {peak.velocity:+.2f} m/s"
        print(f"{frame.time:.2f} s: {found}; box at {truth.range[box]:.2f} m, {truth.velocity[box]:+.2f} m/s")


if __name__ == "__main__":
    main()
