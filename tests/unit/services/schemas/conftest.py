"""What the tests of schemas share: a validator that is not ours."""

import pytest


@pytest.fixture(scope="session")
def validator():
    from jsonschema import Draft202012Validator  # noqa: PLC0415 - compiles grammars, in every process that collects

    return Draft202012Validator
