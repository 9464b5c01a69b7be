"""Antennas of TI's evaluation boards: places to the left and up as seen from the radar, and inverted feeds.

- xWR1642BOOST; xWR1843BOOST and IWR6843ISK; AWR1843AOP; IWR6843AOP; IWR6843ISK-ODS: ``antenna_geometry.c`` of TI's
  mmWave SDK and Radar Toolbox (``gAntDef_default``, ``gAntDef_AWR1843AOP``, ``gAntDef_IWR6843AOP``,
  ``gAntDef_IWR6843ODS``; there, down is positive). ``rsp.AWR1843AOP`` of the package ``xwr`` is this array, turned by a
  quarter.
- xWR1443BOOST: as xWR1843BOOST, by the angles in ``MmwDemo_XYZestimation`` of the SDK's demo for xWR14xx.
- Feeds of AOP and ODS: ``antPhaseRot`` of ``AOP_6m_default.cfg`` and ``ODS_6m_default.cfg``, TI 3D people counting;
  the factors that TI's visualizer writes for ``xWR68xx_AOP`` are the same up to a common sign, and those for
  ``xWR18xx_AOP`` are all 1.
- AWR2944EVM: ``antGeometryCfg`` of TI's MCU+ SDK, 0.5 and 0.8 wavelengths; TX2 is the higher one (package ``xwr``,
  ``rsp.AWR2944EVM``).
- AWRL6844EVM: ``mmw_cli.c`` of TI's mmWave L-SDK, ``antGeometryBoard xWRL6844EVM``; rows count upwards, as in its
  ``aoa2dproc.c``. ``antGeometry0`` and ``antGeometry1`` of TI's in-cabin demo are the same. Samples of captures:
  receiver after receiver, as in ``xwr``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Places = tuple[tuple[float, float], ...]

_ROW: _Places = ((0, 0), (1, 0), (2, 0), (3, 0))


class Board(NamedTuple):
    """Antennas of a board.

    `tx` and `rx` are steps to the left and up: of half a wavelength, or of `spacing` [m]. Factors of the channels,
    ``tx_signs * rx_signs``, undo inverted feeds.
    """

    name: str
    tx: _Places
    rx: _Places = _ROW
    tx_signs: tuple[float, ...] = (1, 1, 1, 1)
    rx_signs: tuple[float, ...] = (1, 1, 1, 1)
    spacing: tuple[float, float] | None = None

    def positions(self, wavelength: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions of all transmitters and of all receivers [m], (antenna, 3)."""
        left, up = self.spacing or (0.5 * wavelength, 0.5 * wavelength)
        tx, rx = (np.array([(0.0, left * y, up * z) for y, z in places]) for places in (self.tx, self.rx))
        return tx, rx

    @property
    def signs(self) -> NDArray[np.float64]:
        """Factors of all channels (transmitter, receiver)."""
        return np.outer(self.tx_signs[: len(self.tx)], self.rx_signs[: len(self.rx)])


_MIDDLE_IS_HIGHER: _Places = ((0, 0), (2, 1), (4, 0))

_BOARDS: dict[tuple[str, ...], Board] = {
    ("WR18", "AOP"): Board("AWR1843AOP", ((0, 0), (0, -1), (0, -2)), ((3, 0), (2, 0), (1, 0), (0, 0))),
    ("WR68", "AOP"): Board(
        "IWR6843AOP", ((0, 0), (2, -2), (0, -2)), ((1, -1), (1, 0), (0, -1), (0, 0)), rx_signs=(-1, 1, -1, 1)
    ),
    ("WR68", "ODS"): Board(
        "IWR6843ISK-ODS", ((0, 0), (2, 0), (2, -2)), ((0, 0), (0, -1), (1, -1), (1, 0)), rx_signs=(1, -1, -1, 1)
    ),
    ("AOP",): Board("", ()),
    ("ODS",): Board("", ()),
    ("WRL684",): Board(
        "AWRL6844EVM",
        ((2, 2), (0, 2), (0, 0), (2, 0)),
        ((0, 1), (0, 0), (1, 0), (1, 1)),
        tx_signs=(-1, 1, -1, 1),
        spacing=(2.54e-3, 2.54e-3),
    ),
    ("WR29",): Board("AWR2944EVM", ((0, 0), (2, 1.6), (4, 0), (8, 0))),
    ("WR12",): Board("xWR1243BOOST", _MIDDLE_IS_HIGHER),
    ("WR14",): Board("xWR1443BOOST", _MIDDLE_IS_HIGHER),
    ("WR16",): Board("xWR1642BOOST", ((0, 0), (4, 0))),
    ("WR18",): Board("xWR1843BOOST", _MIDDLE_IS_HIGHER),
    ("WR68",): Board("IWR6843ISK", _MIDDLE_IS_HIGHER),
}
"""By parts of the names of devices, the first that fits; boards without antennas are not known."""


def board_of(device: str) -> Board | None:
    """The board of a device such as ``"xWR68xx_AOP"`` or ``"awr1843"``; None for another."""
    name = device.upper()
    found = next((board for parts, board in _BOARDS.items() if all(part in name for part in parts)), None)
    return found if found is not None and found.tx else None


def of_channels(
    places: ArrayLike,
    num_rx: int,
    where: str,
    signs: ArrayLike | None = None,
    spacing: tuple[float, float] | None = None,
) -> Board:
    """The antennas of channels (channel, 2), all receivers of TX1 first, and the factors of these channels."""
    steps = np.asarray(places, np.float64).reshape(-1, num_rx, 2)
    tx, rx = steps[:, 0], steps[0] - steps[0, 0]
    if not np.allclose(tx[:, None] + rx, steps):
        raise ValueError(f"{where}: expected a geometry in which all transmitters have the same receivers")
    factors = np.ones(steps.shape[:2]) if signs is None else np.asarray(signs, np.float64).reshape(steps.shape[:2])
    if not (np.abs(factors) == 1.0).all() or not np.array_equal(
        np.outer(factors[:, 0], factors[0]) * factors[0, 0], factors
    ):
        raise ValueError(f"{where}: expected antPhaseRot of a sign per transmitter and receiver")
    return Board(
        "by the configuration",
        tuple(map(tuple, tx.tolist())),
        tuple(map(tuple, rx.tolist())),
        tuple(factors[:, 0].tolist()),
        tuple((factors[0] * factors[0, 0]).tolist()),
        spacing,
    )
