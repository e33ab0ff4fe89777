from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from studio_page import OPTIONS, SHARED, find_chromium

from humanoid_getup.progress import worker

if TYPE_CHECKING:
    from playwright.sync_api import Browser

PRELOADED = (
    "humanoid_getup.commands.get_up.rise",
    "humanoid_getup.commands.motions.import_keys",
    "humanoid_getup.studio.edit_keys",
    "humanoid_getup.studio.pose_robot",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test of the page, so that `make test-studio` alone runs it."""
    for item in items:
        if item.path.is_relative_to(Path(__file__).parent):
            item.add_marker(pytest.mark.studio)


@pytest.fixture(scope="session")
def browser() -> Iterator["Browser"]:
    api = pytest.importorskip("playwright.sync_api")
    chromium = find_chromium()
    if chromium is None:
        pytest.skip("no Chromium: make test-studio installs it")
    with api.sync_playwright() as play:
        opened = play.chromium.launch(executable_path=chromium, args=list(OPTIONS))
        yield opened
        SHARED.close()
        opened.close()


@pytest.fixture(scope="session", autouse=True)
def job_server() -> Iterator[None]:
    """Fork the processes of jobs from one that has imported what they need, as it takes seconds."""
    context = get_context("forkserver")
    context.set_forkserver_preload(list(PRELOADED))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worker, "SPAWN", context)
        yield
