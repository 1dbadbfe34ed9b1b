"""Reads films back, as those who look at them do."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image


@dataclass(frozen=True)
class ReadFilm:
    """What is in a film: its frames (frames, rows, columns, 3), and how long they last [s]."""

    frames: NDArray[np.uint8]
    seconds: float


def read_film(path: Path) -> ReadFilm:
    """Read an mp4 by OpenCV, a GIF or a WebP by Pillow."""
    if path.suffix == ".mp4":
        return _read_video(path)
    frames, milliseconds = [], 0
    with Image.open(path) as picture:
        for number in range(picture.n_frames):
            picture.seek(number)
            frames.append(np.array(picture.convert("RGB")))
            milliseconds += picture.info["duration"]
    return ReadFilm(np.stack(frames), milliseconds / 1000.0)


def _read_video(path: Path) -> ReadFilm:
    capture, frames = cv2.VideoCapture(str(path)), []
    rate = capture.get(cv2.CAP_PROP_FPS)
    is_read, frame = capture.read()
    while is_read:
        frames.append(frame[..., ::-1])
        is_read, frame = capture.read()
    capture.release()
    return ReadFilm(np.stack(frames), len(frames) / rate)


def share_of(frame: NDArray[np.uint8], colour: tuple[int, int, int]) -> float:
    """Return how much of a frame has a colour, but for what a codec changes."""
    return float((np.abs(frame.astype(int) - colour) <= 12).all(axis=2).mean())
