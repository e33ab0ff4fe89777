"""What keeps the tests as they should be."""

from paths import REPOSITORY
from sure_assertions import find_unsure_tests


def test_no_test_passes_because_its_loop_is_empty():
    """`nonempty` of tests/support is the remedy."""
    files = sorted((REPOSITORY / "tests").rglob("test_*.py"))
    assert len(files) > 200
    assert {file.name: unsure for file in files if (unsure := find_unsure_tests(file))} == {}
