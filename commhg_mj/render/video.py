"""Files: H.264 in MP4 that browsers play, and PNG."""

from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

QUALITY = {"crf": "21", "preset": "veryfast", "tune": "animation"}
BT601 = 6  # FFmpeg's number for the colour matrix that OpenCV converts with


def to_yuv(picture) -> np.ndarray:
    """A picture [height, width, 3] as H.264 wants it: planes of brightness and colour, [1.5 height, width]."""
    return cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_I420)


def write_mp4(path, pictures, size, fps) -> None:
    """Encode pictures, as `to_yuv` makes them, in order.

    Raises:
      OSError: the video library cannot.
    """
    try:
        # Without its protocol, a name that holds a colon is read as an address.
        with av.open(f"file:{path}", "w", options={"movflags": "+faststart"}) as container:
            stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001), options=QUALITY)
            stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
            stream.codec_context.colorspace = BT601
            stream.codec_context.thread_count = 1
            for picture in pictures:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="yuv420p")))
            container.mux(stream.encode())
    except av.FFmpegError as error:
        raise OSError(f"the video library says: {error.strerror}") from None


def write_png(path, picture) -> None:
    """Write a picture [height, width, 3]."""
    Path(path).write_bytes(cv2.imencode(".png", picture)[1].tobytes())
