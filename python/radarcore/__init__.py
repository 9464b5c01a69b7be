"""FMCW radar simulation for robotics: meshes in, ADC samples and range-velocity maps out.

SI units and radians unless a name says otherwise; cubes are ``[frame, channel, chirp, sample]``; velocity is range
rate, receding positive; the sensor looks along +x, y is left and z up.
"""

from radarcore import models, plot, sensor
from radarcore._core import __version__
from radarcore.depth.frame import frame_from_depth
from radarcore.geometry import shapes
from radarcore.geometry.camera import Camera
from radarcore.geometry.files import load_mesh, load_meshes
from radarcore.geometry.mesh import Mesh
from radarcore.geometry.pose import Pose
from radarcore.geometry.report import MeshReport, mesh_report
from radarcore.motion.attached import Attached
from radarcore.motion.deformation import Deformation
from radarcore.motion.function import Function
from radarcore.motion.linear import Linear
from radarcore.motion.trajectory import Trajectory
from radarcore.processing.peaks import Peak, strongest_peak
from radarcore.processing.spectra import range_doppler, range_profile
from radarcore.processing.time_frequency import RangeTime, Spectrogram, range_time, spectrogram
from radarcore.radar.pattern import GaussianPattern, IsotropicPattern, TabulatedPattern
from radarcore.radar.presets import bgt60tr13c
from radarcore.radar.radar import Radar
from radarcore.radar.receiver import Receiver
from radarcore.radar.waveform import Waveform
from radarcore.recording.frame import Frame, Truth
from radarcore.recording.recording import Recording
from radarcore.recording.writer import RecordingWriter
from radarcore.scene.body import Body, PointTarget
from radarcore.scene.library import materials
from radarcore.scene.material import Material
from radarcore.scene.permittivity import ColeCole, ItuPermittivity
from radarcore.scene.scene import Scene
from radarcore.scenefile.load import load_scene
from radarcore.scenefile.simulation import Simulation
from radarcore.sensor import open_sensor
from radarcore.simulate.cross_section import rcs
from radarcore.simulate.depth_image import DepthImage
from radarcore.simulate.simulator import Paths, Simulator
from radarcore.simulate.synthesis import Plan, PlanPart, beat_signal, plan_beat_signal

__all__ = [
    "Attached",
    "Body",
    "Camera",
    "ColeCole",
    "Deformation",
    "DepthImage",
    "Frame",
    "Function",
    "GaussianPattern",
    "IsotropicPattern",
    "ItuPermittivity",
    "Linear",
    "Material",
    "Mesh",
    "MeshReport",
    "Paths",
    "Peak",
    "Plan",
    "PlanPart",
    "PointTarget",
    "Pose",
    "Radar",
    "RangeTime",
    "Receiver",
    "Recording",
    "RecordingWriter",
    "Scene",
    "Simulation",
    "Simulator",
    "Spectrogram",
    "TabulatedPattern",
    "Trajectory",
    "Truth",
    "Waveform",
    "__version__",
    "beat_signal",
    "bgt60tr13c",
    "frame_from_depth",
    "load_mesh",
    "load_meshes",
    "load_scene",
    "materials",
    "mesh_report",
    "models",
    "open_sensor",
    "plan_beat_signal",
    "plot",
    "range_doppler",
    "range_profile",
    "range_time",
    "rcs",
    "sensor",
    "shapes",
    "spectrogram",
    "strongest_peak",
]
