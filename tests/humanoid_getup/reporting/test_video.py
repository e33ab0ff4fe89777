"""Videos that play again and again."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from humanoid_getup.reporting.video import write_video

FRAMES = [np.full((8, 8, 3), 25 * number, np.uint8) for number in range(10)]


@pytest.mark.parametrize("suffix", ["gif", "webp"])
def test_every_picture_is_shown_for_the_time_of_the_rate(tmp_path: Path, suffix: str):
    path = tmp_path / f"rise.{suffix}"
    write_video(FRAMES, 20, path)
    with Image.open(path) as video:
        assert video.n_frames == len(FRAMES)
        for number, frame in enumerate(FRAMES):
            video.seek(number)
            video.load()
            assert video.info["duration"] == 50  # ms
            shown = np.asarray(video.convert("RGB"), float)
            assert np.abs(shown - frame).max() < 6.0
