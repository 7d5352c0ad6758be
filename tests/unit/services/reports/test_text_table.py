"""Tables as text: nothing is lost, and they fit where single words let them."""

from hypothesis import given
from hypothesis import strategies as st

from wetwell.services.reports.text_table import SCREEN_WIDTH, folded, text_table

WORD = st.text(alphabet="abcdefgh", min_size=1, max_size=12)
CELL = st.lists(WORD, max_size=12).map(" ".join)


@given(names=st.lists(WORD, min_size=1, max_size=12, unique=True), data=st.data())
def test_a_table_fits_and_says_all(names, data):
    rows = data.draw(st.lists(st.fixed_dictionaries(dict.fromkeys(names, CELL)), min_size=1, max_size=4))
    lines = text_table(rows)
    assert max(map(len, lines)) <= SCREEN_WIDTH
    said = sorted(word for line in lines for word in line.split())
    wanted = [word for name in names for row in [{name: name}, *rows] for word in row[name].split()]
    head = next(iter(rows[0]))
    first = [word for row in [{head: head}, *rows] for word in row[head].split()]
    again, rest = divmod(len(said) - len(wanted), len(first))
    assert rest == 0
    assert said == sorted(wanted + first * again)


def test_numbers_are_never_broken():
    rows = [{f"pump{number}_specific_energy_kwh_m3": 1234.56789 for number in range(1, 9)}]
    lines = text_table(rows)
    assert max(map(len, lines)) <= SCREEN_WIDTH
    assert " ".join(lines).split().count("1234.56789") > 8  # the first column stands before each further block


def test_rows_of_unlike_keys_have_all_columns():
    assert text_table([{"a": 1}, {"a": 2, "b": 3}]) == ["a  b", "1", "2  3"]


@given(indent=st.integers(0, 20), words=st.lists(WORD, min_size=1, max_size=60), hang=st.integers(0, 20))
def test_a_long_line_goes_on_in_the_next_and_says_all(indent, words, hang):
    lines = folded(" " * indent + " ".join(words), hang).splitlines()
    assert max(map(len, lines)) <= SCREEN_WIDTH
    assert [word for line in lines for word in line.split()] == words
    assert [len(line) - len(line.lstrip()) for line in lines] == [indent] + [indent + hang] * (len(lines) - 1)


def test_lines_that_fit_stay_as_they_are():
    text = "ok       router     answers\n\n    begins  here"
    assert folded(text) == text
