"""Who may do what on the bus: a table of roles in TOML, and the rules for a Zenoh router that come from it.

A role names what it may publish, read, ask and answer; everything else is denied. The key `@tail` under a
key belongs to it: there a publisher says which message was its last.
"""

from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, ValidationError, model_validator

from wetwell.protocols.bus.keys import PACE, ROOT, tail_key
from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.station.station_file import NAME_PATTERN, load_toml
from wetwell.protocols.station.table import Table

Name = Annotated[str, Field(pattern=NAME_PATTERN)]
Key = Annotated[str, Field(pattern=r"^[^/\s#?]+(/[^/\s#?]+)*$")]

PUBLISH = ("put", "delete", "declare_queryable", "reply", "liveliness_token")
READ = ("declare_subscriber", "query", "declare_liveliness_subscriber", "liveliness_query")
ASK = ("query",)
ANSWER = ("declare_queryable", "reply")
ALL = tuple(dict.fromkeys(PUBLISH + READ))


class BusRole(Table):
    """What some users may do; a user is the name in `zenoh.user`, or the common name of a certificate.

    `publish` includes to show under a key that one lives and to answer a `get` on it, `read` to ask for the last
    message.
    """

    name: Name
    users: tuple[Name, ...] = ()
    publish: tuple[Key, ...] = ()
    read: tuple[Key, ...] = ()
    ask: tuple[Key, ...] = ()
    answer: tuple[Key, ...] = ()

    @property
    def who(self) -> tuple[str, ...]:
        """Its users; without any, the one that is named like the role."""
        return self.users or (self.name,)


class AccessTable(Table):
    """All roles of a site."""

    role: Annotated[tuple[BusRole, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _names_once(self) -> Self:
        names = [role.name for role in self.role]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"role '{name}' is there {names.count(name)} times")
        return self

    def zenoh_rules(self, *, by_certificate: bool) -> dict[str, Any]:
        """Configuration `access_control` of a Zenoh router.

        What a client sends is held against its role. What it gets needs no rule: it is what the client subscribed to
        or asked for.

        Parameters
        ----------
        by_certificate : bool
            Whether a user is known by the common name of a certificate; else by the name that goes with a password.

        Examples
        --------
        >>> table = AccessTable(role=(BusRole(name="viewer", read=("wetwell/*/sample",)),))
        >>> [rule["key_exprs"] for rule in table.zenoh_rules(by_certificate=False)["rules"]][0]
        ['wetwell/*/sample', 'wetwell/*/sample/@tail']
        """
        known_by = "cert_common_names" if by_certificate else "usernames"
        rules = [
            _rule(f"{role.name}-{act}", messages, "ingress", keys)
            for role in self.role
            for act, messages, keys in (
                ("publish", PUBLISH, role.publish),
                ("read", READ, role.read),
                ("ask", ASK, role.ask),
                ("answer", ANSWER, role.answer),
            )
            if keys
        ]
        common = [
            _rule("delivery", ALL, "egress", (f"{ROOT}/**",)),
            _rule("pace", ("liveliness_query",), "ingress", (PACE,)),
        ]
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": rules + common,
            "subjects": [{"id": role.name, known_by: list(role.who)} for role in self.role],
            "policies": [
                {
                    "subjects": [role.name],
                    "rules": [
                        *(rule["id"] for rule in rules if rule["id"].rpartition("-")[0] == role.name),
                        *(rule["id"] for rule in common),
                    ],
                }
                for role in self.role
            ],
        }


def load_access(file: Path) -> AccessTable:
    """Table of roles from a TOML file.

    Raises
    ------
    ConfigError
        If it cannot be read or breaks a rule.
    """
    try:
        return AccessTable.model_validate(load_toml(file))
    except ValidationError as error:
        raise ConfigError(f"{file}: {first_fault(error)}") from error


def _rule(name: str, messages: tuple[str, ...], flow: str, keys: tuple[str, ...]) -> dict[str, Any]:
    return {
        "id": name,
        "messages": list(messages),
        "flows": [flow],
        "permission": "allow",
        "key_exprs": [*keys, *(tail_key(key) for key in keys)],
    }
