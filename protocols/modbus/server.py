"""Modbus TCP server of one station: the register table as a process image that clients read and set.

The only import of pymodbus. Its datastore is a mere shape: before each request is served, `_guard` copies the words
asked for from the image, or hands the values to be written to the PLC program, which may refuse them.
"""

import asyncio
import contextvars
import logging
import socket
import ssl
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Self

from pymodbus.constants import ExcCodes, ModbusStatus
from pymodbus.datastore import ModbusServerContext
from pymodbus.exceptions import ModbusIOException
from pymodbus.framer import FramerType
from pymodbus.pdu import ExceptionResponse, ModbusPDU
from pymodbus.pdu.bit_message import WriteSingleCoilRequest
from pymodbus.pdu.register_message import ReadWriteMultipleRegistersRequest
from pymodbus.server import ModbusTcpServer, ModbusTlsServer
from pymodbus.server.requesthandler import ServerRequestHandler
from pymodbus.simulator import DataType, SimData, SimDevice

from wetwell.protocols.errors import LinkError
from wetwell.protocols.modbus.registers import (
    SETTINGS_BLOCK,
    Register,
    Table,
    WordOrder,
    decode,
    encode,
    measured_words,
    register_table,
)
from wetwell.protocols.modbus.write_permission import (
    LOOPBACK_WRITES,
    WritePermission,
    allowed_registers,
    check_permissions,
)

_log = logging.getLogger(__name__)
_COIL_CODES = frozenset({1, 5, 15})
_SERVED_CODES = _COIL_CODES | {3, 4, 6, 16, 22, 23}
"""All others get exception 01; pymodbus would answer some from thin air and some with a traceback in the log."""
_HANDSHAKE_S = 90.0
"""So long after it began, a connection that has not come about is forgotten; asyncio gives TLS 60 s."""
_client: contextvars.ContextVar[str] = contextvars.ContextVar("client")
"""Address of the client whose request is being served."""
_UNNAMED = 0x80
"""Function code of pymodbus' answer to a request that it did not decode."""


class ModbusServer:
    """Async context manager that serves the register table of a station.

    Characteristics: buffered: no, the last `update` is served · when full: never · threads: none, call `update`
    from the event loop, which also calls `on_write` · reconnect: clients come and go, one outstanding request each.

    Parameters
    ----------
    host, port : str, int
        Address to listen on; port 0 takes a free one.
    unit_id : int
        The only unit id that is served, 0 to 255; others get exception 11.
    word_order : "ABCD" or "CDAB"
        Of all 32-bit values.
    pumps, levels : int
        Size of the register table.
    on_write : callable
        Gets {register name: new value} of all that one request changes, before it changes; a ValueError refuses the
        request with exception 03. Writes that are no registers, or half of one, or read-only get exception 02.
    witness : callable, optional
        Gets address of the client, {register name: value} and why it was refused, empty if it was not, of each write
        that has changed something, or that client or PLC program may not do.
    tls : ssl.SSLContext, optional
        Speak Modbus over TLS only.
    write_allow : sequence of WritePermission
        Who may write what. A client that may write nothing gets exception 01, one that may not write all that a
        request asks for gets 02; both are logged.

    Attributes
    ----------
    requests, refused : int
        Requests answered, and those of them answered with an exception.
    """

    def __init__(
        self,
        *,
        host: str,
        port: int,
        unit_id: int,
        word_order: WordOrder,
        pumps: int,
        levels: int,
        on_write: Callable[[Mapping[str, float]], None],
        witness: Callable[[str, Mapping[str, float], str], None] = lambda _client, _changes, _refused: None,
        tls: ssl.SSLContext | None = None,
        write_allow: Sequence[WritePermission] = LOOPBACK_WRITES,
    ) -> None:
        if not 0 <= unit_id <= 255:
            raise ValueError(f"unit_id must lie in [0, 255], got {unit_id}")
        self._host, self._port, self._unit_id, self._word_order = host, port, unit_id, word_order
        self._on_write, self._witness, self._tls, self._write_allow = on_write, witness, tls, write_allow
        self._measured_words, self._setting_words = measured_words(pumps), 4 * levels
        self._rows = {row.name: row for row in register_table(pumps, levels) if row.table != "input"}
        self._writable = {(row.table, row.address): row for row in self._rows.values() if row.access == "rw"}
        self._names = [row.name for row in self._writable.values()]
        check_permissions(write_allow, self._names)
        self._image: dict[Table, list[int]] = {
            "coil": [0] * pumps,
            "holding": [0] * (SETTINGS_BLOCK + self._setting_words),
        }
        self._server: ModbusTcpServer | None = None
        self._received = b""
        self.requests = 0
        self.refused = 0
        self.update(dict.fromkeys(self._rows))

    @property
    def port(self) -> int:
        """Port that is listened on."""
        return self._port

    @property
    def clients(self) -> int:
        """Number of open connections."""
        connections = self._server.active_connections.values() if self._server else ()
        return sum(connection.transport is not None for connection in connections)

    def update(self, values: Mapping[str, float | None]) -> None:
        """Set values in the process image, all or none; a request sees them before or after, never half.

        Raises
        ------
        ValueError
            If a name is not in the table or a value does not fit its register.
        """
        encoded: list[tuple[Register, list[int]]] = []
        for name, value in values.items():
            row = self._rows.get(name)
            if row is None:
                raise ValueError(f"{name!r} is not a register of this station")
            encoded.append((row, encode(row, value, self._word_order)))
        for row, words in encoded:
            self._image[row.table][row.address : row.address + row.count] = words

    async def __aenter__(self) -> Self:
        endpoint = f"Modbus TCP {self._host}:{self._port}"
        loop = asyncio.get_running_loop()
        try:  # pymodbus keeps the reason to itself: ask first
            trial = await loop.create_server(
                asyncio.Protocol, self._host, self._port, reuse_address=True, start_serving=False
            )
        except OSError as error:
            reason = str(error.strerror or error).rpartition(": ")[2]
            raise LinkError(f"{endpoint}: cannot listen: {reason}") from error
        trial.close()
        server = self._make_server()
        try:
            await server.serve_forever(background=True)
        except RuntimeError as error:
            raise LinkError(f"{endpoint}: cannot listen") from error
        if isinstance(server.transport, asyncio.Server):
            for listener in server.transport.sockets:
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)  # connections inherit it
                self._port = listener.getsockname()[1]
        self._server = server
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        server, self._server = self._server, None
        if server is None:
            return
        for connection in tuple(server.active_connections.values()):
            if isinstance(connection.transport, asyncio.Transport):
                connection.transport.abort()  # close() would wait for a peer that does not read
        server.close()
        for _ in range(5):  # passes of the loop that a request just received, or a lost connection, needs to end
            await asyncio.sleep(0)

    def _make_server(self) -> ModbusTcpServer:
        address, custom_pdu = (self._host, self._port), [_WriteCoil, _ReadWrite]
        if self._tls is None:
            return _TcpServer(
                self._device(),
                address=address,
                trace_packet=self._trace_packet,
                trace_pdu=self._trace_pdu,
                custom_pdu=custom_pdu,
            )
        return _TlsServer(
            self._device(),
            address=address,
            trace_packet=self._trace_packet,
            trace_pdu=self._trace_pdu,
            custom_pdu=custom_pdu,
            sslctx=self._tls,
            framer=FramerType.SOCKET,  # the same on the wire as pymodbus' own for TLS, which needs whole frames
        )

    def _device(self) -> SimDevice:
        coils = SimData(0, values=[False] * len(self._image["coil"]), datatype=DataType.BITS)
        discretes = SimData(0, values=[False], datatype=DataType.BITS)  # never served, but may not be absent
        measured = SimData(0, values=[0] * self._measured_words, datatype=DataType.REGISTERS)
        settings = SimData(SETTINGS_BLOCK, values=[0] * self._setting_words, datatype=DataType.REGISTERS)
        tables = ([coils], [discretes], [measured, settings], [measured])
        return SimDevice(self._unit_id, simdata=tables, action=self._guard)

    async def _guard(
        self,
        function: int,
        start: int,
        address: int,
        count: int,
        served: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        """Let a request pass, or say why not; `start` and `served` are words, also where `address` is a coil's."""
        table: Table = "coil" if function in _COIL_CODES else "holding"
        if values:
            return self._write(table, address, values)
        image = self._image[table]
        if table == "holding":
            served[address - start : address - start + count] = image[address : address + count]
            return None
        if address >= len(image):
            return ExcCodes.ILLEGAL_ADDRESS
        for word in range(len(served) - 1):  # the last one is pymodbus' own end mark
            served[word] = sum(bit << n for n, bit in enumerate(image[16 * word : 16 * word + 16]))
        return None

    def _write(self, table: Table, address: int, values: Sequence[int]) -> ExcCodes | None:
        client = _client.get()
        allowed = allowed_registers(self._write_allow, client, self._names)
        if not allowed:
            _log.warning("write from %s refused: it may write nothing (modbus.write_allow)", client)
            self._witness(client, {}, "may write nothing")
            return ExcCodes.ILLEGAL_FUNCTION
        changes: dict[str, float] = {}
        at, end = 0, len(values)
        while at < end:
            row = self._writable.get((table, address + at))
            if row is None or at + row.count > end:
                return ExcCodes.ILLEGAL_ADDRESS
            value = decode(row, values[at : at + row.count], self._word_order)
            if value is None:
                return ExcCodes.ILLEGAL_VALUE
            changes[row.name] = value
            at += row.count
        forbidden = [name for name in changes if name not in allowed]
        if forbidden:
            _log.warning("write of %s from %s refused (modbus.write_allow)", ", ".join(forbidden), client)
            self._witness(client, changes, f"may not write {', '.join(forbidden)}")
            return ExcCodes.ILLEGAL_ADDRESS
        try:
            self._on_write(changes)
        except ValueError as error:
            _log.info("write of %s from %s refused: %s", ", ".join(changes), client, error)
            self._witness(client, changes, str(error))
            return ExcCodes.ILLEGAL_VALUE
        _log.info("%s writes %s", client, ", ".join(f"{name} = {value:g}" for name, value in changes.items()))
        words = list(map(int, values))
        if self._image[table][address : address + end] != words:
            self._image[table][address : address + end] = words
            self._witness(client, changes, "")
        return None

    def _trace_packet(self, sending: bool, packet: bytes) -> bytes:
        if not sending:
            self._received = packet
        return packet

    def _trace_pdu(self, sending: bool, pdu: ModbusPDU) -> ModbusPDU:
        """Refuse what is not for this unit, count the answers, and name the function that could not be decoded."""
        if not sending:
            if pdu.dev_id != self._unit_id or pdu.function_code not in _SERVED_CODES:
                raise ModbusIOException("not served", transaction_id=pdu.transaction_id, dev_id=pdu.dev_id)
            return pdu
        self.requests += 1
        if isinstance(pdu, ExceptionResponse):
            self.refused += 1
            if pdu.function_code == _UNNAMED:  # answered at once, so the packet received last is the one refused
                unit_id, function = self._received[6:8]
                pdu.function_code = function | _UNNAMED
                pdu.exception_code = self._reason(unit_id, function)
        return pdu

    def _reason(self, unit_id: int, function: int) -> ExcCodes:
        if unit_id != self._unit_id:
            return ExcCodes.GATEWAY_NO_RESPONSE
        return ExcCodes.ILLEGAL_VALUE if function in _SERVED_CODES else ExcCodes.ILLEGAL_FUNCTION


class _Handler(ServerRequestHandler):
    """One connection, which knows whose request it serves."""

    def __init__(self, server: ModbusTcpServer, begin_s: float) -> None:
        super().__init__(server, server.trace_packet, server.trace_pdu, server.trace_connect)  # type: ignore[no-untyped-call]
        self.begin_s = begin_s

    async def handle_request(self) -> None:
        if isinstance(self.transport, asyncio.Transport):
            _client.set(self.transport.get_extra_info("peername", ("::",))[0])  # each request is a task of its own
            await super().handle_request()  # type: ignore[no-untyped-call]


class _Connections(ModbusTcpServer):
    """What both servers do with a new connection."""

    def callback_new_connection(self) -> _Handler:
        now_s = asyncio.get_running_loop().time()
        for name, old in tuple(self.active_connections.items()):  # pymodbus keeps those whose handshake has failed
            if old.transport is None and isinstance(old, _Handler) and now_s - old.begin_s > _HANDSHAKE_S:
                del self.active_connections[name]
        return _Handler(self, now_s)


class _TcpServer(_Connections):
    """Modbus TCP."""


class _TlsServer(_Connections, ModbusTlsServer):
    """Modbus over TLS."""


class _WriteCoil(WriteSingleCoilRequest):
    """Function code 05 that takes no other values than on and off."""

    def decode(self, data: bytes) -> None:
        super().decode(data)
        if int.from_bytes(data[2:4], "big") not in {ModbusStatus.ON, ModbusStatus.OFF}:
            raise ValueError("a coil is written with FF00 or 0000")


class _ReadWrite(ReadWriteMultipleRegistersRequest):
    """Function code 23 that writes nothing where its read part must be refused."""

    async def datastore_update(self, context: ModbusServerContext, device_id: int) -> ModbusPDU:
        found = await context.async_getValues(device_id, self.function_code, self.read_address, self.read_count)
        if isinstance(found, ExcCodes):
            return ExceptionResponse(self.function_code, found)
        return await super().datastore_update(context, device_id)
