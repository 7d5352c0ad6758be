"""Who may write what on a Modbus server: by the address of the client and the name of the register."""

import ipaddress
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


@dataclass(frozen=True, slots=True)
class WritePermission:
    """Registers that the clients of a network may write.

    Attributes
    ----------
    client : network
        Such as 192.0.2.0/24.
    registers : tuple of str
        Names of registers; `*` stands for any part of a name.
    """

    client: Network
    registers: tuple[str, ...]


LOOPBACK_WRITES = tuple(WritePermission(ipaddress.ip_network(net), ("*",)) for net in ("127.0.0.0/8", "::1/128"))
"""Programs on this machine may write all, others nothing."""


def allowed_registers(permissions: Iterable[WritePermission], client: str, writable: Sequence[str]) -> frozenset[str]:
    """Those of the writable registers that a client may write.

    Parameters
    ----------
    permissions : iterable of WritePermission
        All that are granted.
    client : str
        Address of the client; an IPv4 address in the form of IPv6 counts as the former.
    writable : sequence of str
        Names of all registers that can be written.

    Examples
    --------
    >>> sorted(allowed_registers(LOOPBACK_WRITES, "::ffff:127.0.0.1", ["pump1_auto", "start_level1_m"]))
    ['pump1_auto', 'start_level1_m']
    >>> allowed_registers(LOOPBACK_WRITES, "192.0.2.7", ["pump1_auto"])
    frozenset()
    """
    address = ipaddress.ip_address(client.partition("%")[0])
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
        address = address.ipv4_mapped
    patterns = [pattern for one in permissions if address in one.client for pattern in one.registers]
    return frozenset(name for name in writable if any(fnmatchcase(name, pattern) for pattern in patterns))


def check_permissions(permissions: Iterable[WritePermission], writable: Sequence[str]) -> None:
    """Refuse a permission for a register that is not there.

    Raises
    ------
    ValueError
        If one names nothing that can be written.
    """
    for one in permissions:
        for pattern in one.registers:
            if not any(fnmatchcase(name, pattern) for name in writable):
                raise ValueError(
                    f"modbus.write_allow: '{pattern}' (client {one.client}) is no register of this station that can"
                    f" be written; there are {', '.join(writable)}"
                )
