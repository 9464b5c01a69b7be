"""The client of the ZeroMQ remote API, with calls that end: in an answer or in an error."""

from __future__ import annotations

import sys
import time
from typing import Any

from radarcore import check

PORT = 23000
"""Port of the server of CoppeliaSim's first instance."""

_NOTHING = object()


class CoppeliaSimError(OSError):
    """CoppeliaSim did not answer within the time-out, or answered that it cannot do what it was asked.

    See Also
    --------
    adapters.coppeliasim.CoppeliaSim : Raises it.

    Examples
    --------
    >>> try:
    ...     rc.adapters.coppeliasim.CoppeliaSim("127.0.0.1", 1, timeout=0.1)
    ... except rc.adapters.coppeliasim.CoppeliaSimError as error:
    ...     print("nobody answers")
    nobody answers
    """


class Client:
    """Connection to a server, which is asked at once whether it is there.

    Parameters
    ----------
    host, port
        Address of the server.
    timeout : float
        Longest time that a call may take [s].

    Raises
    ------
    ImportError
        Without the extra.
    CoppeliaSimError
        When nobody answers.
    """

    def __init__(self, host: str, port: int, timeout: float) -> None:
        self.timeout: float = check.positive("timeout", timeout, "s")
        self.address: str = f"tcp://{host}:{check.port('port', port)}"
        self.is_open: bool = True
        self._remote = _remote(host, port, self)
        try:
            self.sim: Any = self._remote.require("sim")
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the connection; what was not sent is dropped."""
        self.is_open = False
        self._remote.context.destroy(linger=0)

    def no_answer(self, function: str) -> CoppeliaSimError:
        """Error of a call without an answer."""
        return CoppeliaSimError(
            f"{self.address}: expected an answer to {function} within {self.timeout:g} s, got none; is CoppeliaSim "
            "running, with its ZMQ remote API server on this port? It does not answer while one of its dialogs is "
            "open; slow scenes need a longer timeout"
        )


def _remote(host: str, port: int, owner: Client) -> Any:
    """The client of CoppeliaSim's package, made to keep the time-out of its owner."""
    try:
        import zmq
        from coppeliasim_zmqremoteapi_client import RemoteAPIClient
    except ImportError as error:
        raise ImportError(
            "CoppeliaSim needs coppeliasim-zmqremoteapi-client, pyzmq and cbor2: pip install radarcore[coppelia]"
        ) from error

    class Remote(RemoteAPIClient):  # type: ignore[misc]  # without types
        """One deadline for all messages of a call: `sim.step` takes as many as it waits."""

        deadline: float | None = None
        socket: Any

        def call(self, func: str, args: Any) -> Any:
            if not owner.is_open:
                raise CoppeliaSimError(f"{owner.address}: expected an open connection for {func}, got a closed one")
            is_outermost = self.deadline is None
            if is_outermost:
                self.deadline = time.monotonic() + owner.timeout
            try:
                return super().call(func, args)
            except zmq.Again:
                owner.close()  # the answer may still come, and would be taken for that to the next call
                raise owner.no_answer(func) from None
            except Exception as error:
                if type(error) is not Exception:  # as the client raises for what the server reports
                    raise
                raise CoppeliaSimError(f"{func}: {error}") from error
            except BaseException:  # Ctrl-C: the next call, which stops the simulation, must not wait for this answer
                self.connect()
                raise
            finally:
                if is_outermost:
                    self.deadline = None

        def connect(self) -> None:
            self.socket.close(linger=0)
            self.socket = self.context.socket(zmq.REQ)
            self.prepare()
            self.socket.connect(owner.address)

        def prepare(self) -> None:
            self.socket.setsockopt(zmq.LINGER, 0)
            self.socket.setsockopt(zmq.SNDTIMEO, int(1e3 * owner.timeout))

        def _recv(self) -> Any:
            assert self.deadline is not None  # only called within `call`
            left = max(0.0, self.deadline - time.monotonic())
            if not self.socket.poll(int(1e3 * left)):
                raise zmq.Again
            return super()._recv()

    # The client puts its `require` among the names of the user's program.
    names = vars(sys.modules["__main__"])
    before = names.get("require", _NOTHING)
    try:
        remote = Remote(host, port)
    except zmq.ZMQError as error:
        raise ValueError(f"host: expected the name or address of a machine, got {host!r} ({error})") from error
    finally:
        if before is _NOTHING:
            names.pop("require", None)
        else:
            names["require"] = before
    remote.prepare()
    return remote
