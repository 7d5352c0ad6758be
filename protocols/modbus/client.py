"""Modbus TCP client: one connection, one question at a time, and nothing taken for an answer that is none.

pymodbus makes the questions and reads the answers; the stream is asyncio's own. Its own client takes an answer with
transaction id 0 for any question, keeps the reason of a failed connection to itself, and notices a lost one only when
the time for the answer is over.
"""

import asyncio
import contextlib
import os
import socket
import ssl
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from pymodbus.constants import ExcCodes
from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU, ExceptionResponse
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest, ReadInputRegistersRequest

from wetwell.protocols.errors import LinkError
from wetwell.protocols.modbus.device_signal import BIT_TABLES, SignalTable

HEAD_BYTES = 7
"""Transaction id, protocol id, length, unit id."""
_LONGEST_PDU = 253
_IDLE_S, _INTERVAL_S, _PROBES = 10, 5, 3
"""TCP keep-alive: a peer that is gone is noticed after 25 s, even between polls that lie far apart."""

_REQUESTS = {
    "coil": ReadCoilsRequest,
    "discrete": ReadDiscreteInputsRequest,
    "holding": ReadHoldingRegistersRequest,
    "input": ReadInputRegistersRequest,
}
_decoder = DecodePDU(is_server=False)
_framer = FramerSocket(_decoder)


class NoAnswerError(LinkError):
    """Nothing, or not all of an answer, came in time."""


class WrongAnswerError(LinkError):
    """What came is no answer to the question; what comes next could be the answer to it."""


class RefusedError(LinkError):
    """The device answered with an exception; the connection is good."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked: `count` registers or bits of a table from `address`."""

    transaction_id: int
    unit_id: int
    table: SignalTable
    address: int
    count: int

    def __str__(self) -> str:
        last = self.address + self.count - 1
        return f"{self.table} {self.address} to {last}" if self.count > 1 else f"{self.table} {self.address}"

    def encode(self) -> bytes:
        """Frame of the question."""
        request = _REQUESTS[self.table](
            address=self.address, count=self.count, dev_id=self.unit_id, transaction_id=self.transaction_id
        )
        return _framer.buildFrame(request)


def bytes_to_come(question: Question, head: bytes) -> int:
    """Length of the rest of an answer, by the first `HEAD_BYTES` of it.

    Raises
    ------
    WrongAnswerError
        If they cannot begin an answer to the question.

    Examples
    --------
    >>> bytes_to_come(Question(7, 1, "input", 0, 2), bytes([0, 7, 0, 0, 0, 7, 1]))
    6
    """
    transaction_id, protocol_id, length = (int.from_bytes(head[at : at + 2], "big") for at in (0, 2, 4))
    for name, got, wanted in (
        ("protocol id", protocol_id, 0),
        ("transaction id", transaction_id, question.transaction_id),
        ("unit id", head[6], question.unit_id),
    ):
        if got != wanted:
            raise WrongAnswerError(f"answer to {question}: {name} {got}, asked with {wanted}")
    if not 3 <= length <= _LONGEST_PDU + 1:
        raise WrongAnswerError(f"answer to {question}: length {length}, must lie in [3, {_LONGEST_PDU + 1}]")
    return length - 1


def words_of(question: Question, pdu: bytes) -> list[int]:
    """Registers, or bits as 0 and 1, in an answer without its head.

    Raises
    ------
    RefusedError
        If the answer is an exception.
    WrongAnswerError
        If it is no answer to the question.

    Examples
    --------
    >>> words_of(Question(7, 1, "input", 0, 2), bytes([4, 4, 0x3F, 0x80, 0, 1]))
    [16256, 1]
    """
    function = _REQUESTS[question.table].function_code
    if len(pdu) == 2 and pdu[0] == function | 0x80:
        answer = _decoder.decode(pdu)
        code = answer.exception_code if isinstance(answer, ExceptionResponse) else 0
        raise RefusedError(code, f"{question}: refused with exception {code:02X}{_meaning(code)}")
    if len(pdu) < 2:
        raise WrongAnswerError(f"answer to {question}: {len(pdu)} bytes, must be 2 or more")
    size = -(-question.count // 8) if question.table in BIT_TABLES else 2 * question.count
    if len(pdu) != 2 + size or pdu[0] != function or pdu[1] != size:
        raise WrongAnswerError(
            f"answer to {question}: function {pdu[0]}, count {pdu[1]}, {len(pdu) - 2} bytes; "
            f"must be {function}, {size}, {size}"
        )
    answer = _decoder.decode(pdu)
    if answer is None:
        raise WrongAnswerError(f"answer to {question}: cannot be decoded")
    found = answer.bits if question.table in BIT_TABLES else answer.registers
    return [int(word) for word in found[: question.count]]


def _meaning(code: int) -> str:
    with contextlib.suppress(ValueError):
        return f", {ExcCodes(code).name.lower().replace('_', ' ')}"
    return ""


class ModbusConnection:
    """Async context manager: a connection to one unit of a Modbus TCP server.

    Characteristics: buffered: no · when full: never, one question at a time · threads: none · reconnect: never; after
    any error but `RefusedError` it must be closed, so that a late answer is not taken for the next question's.

    Parameters
    ----------
    host, port : str, int
        Where the server listens.
    unit_id : int
        Whose registers are read, 0 to 255.
    connect_timeout_s, answer_timeout_s : float
        Time after which it is given up. [s]
    tls : ssl.SSLContext, optional
        Speak Modbus over TLS.
    server_name : str, optional
        Name in the server's certificate, where it is not `host`.
    """

    def __init__(
        self,
        host: str,
        port: int,
        unit_id: int,
        *,
        connect_timeout_s: float,
        answer_timeout_s: float,
        tls: ssl.SSLContext | None = None,
        server_name: str | None = None,
    ) -> None:
        self._host, self._port, self._unit_id = host, port, unit_id
        self._connect_timeout_s, self._answer_timeout_s = connect_timeout_s, answer_timeout_s
        self._tls, self._server_name = tls, server_name
        self._transaction_id = 0

    async def __aenter__(self) -> Self:
        name = (self._server_name or self._host) if self._tls is not None else None
        try:
            async with asyncio.timeout(self._connect_timeout_s):
                self._reader, self._writer = await asyncio.open_connection(
                    self._host, self._port, ssl=self._tls, server_hostname=name
                )
        except TimeoutError as error:
            raise LinkError(f"cannot connect: no answer within {self._connect_timeout_s:g} s") from error
        except ssl.SSLCertVerificationError as error:
            raise LinkError(f"cannot connect: certificate refused: {error.verify_message}") from error
        except (OSError, UnicodeError) as error:
            raise LinkError(f"cannot connect: {_reason(error)}") from error
        _keep_alive(self._writer.get_extra_info("socket"))
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.transport.abort()  # close() would wait for a peer that does not read
        with contextlib.suppress(OSError):
            await self._writer.wait_closed()

    async def read(self, table: SignalTable, address: int, count: int) -> list[int]:
        """Registers, or bits as 0 and 1.

        Raises
        ------
        RefusedError
            If the device answers with an exception; its code is in `code`.
        NoAnswerError, WrongAnswerError, LinkError
            If no answer comes, a wrong one, or the connection is lost. It must be closed then.
        """
        self._transaction_id = self._transaction_id % 0xFFFF + 1
        question = Question(self._transaction_id, self._unit_id, table, address, count)
        try:
            async with asyncio.timeout(self._answer_timeout_s):
                self._writer.write(question.encode())
                await self._writer.drain()
                head = await self._reader.readexactly(HEAD_BYTES)
                pdu = await self._reader.readexactly(bytes_to_come(question, head))
        except TimeoutError as error:
            raise NoAnswerError(f"{question}: no answer within {self._answer_timeout_s:g} s") from error
        except asyncio.IncompleteReadError as error:
            raise LinkError(f"{question}: connection closed by the device") from error
        except OSError as error:
            raise LinkError(f"{question}: connection lost: {_reason(error)}") from error
        return words_of(question, pdu)


def _reason(error: Exception) -> str:
    """What the system says; asyncio puts a text of its own in the place of it."""
    if isinstance(error, ssl.SSLError | socket.gaierror):
        return (error.strerror or str(error)).lower()
    return os.strerror(error.errno).lower() if isinstance(error, OSError) and error.errno else str(error)


def _keep_alive(connection: socket.socket) -> None:
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in (
        (socket.TCP_KEEPIDLE, _IDLE_S),
        (socket.TCP_KEEPINTVL, _INTERVAL_S),
        (socket.TCP_KEEPCNT, _PROBES),
    ):
        connection.setsockopt(socket.IPPROTO_TCP, option, value)
