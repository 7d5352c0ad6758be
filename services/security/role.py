"""Roles of those who use the dashboard; apart from the tokens, so that the command line need not load them."""

from typing import Literal

Role = Literal["viewer", "operator"]
"""A viewer may look, an operator may also act. Later ones may all that earlier ones may."""
