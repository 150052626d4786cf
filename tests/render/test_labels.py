import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from commhg_mj.render.labels import Label, place_labels

SIZE = (640, 360)
points = st.tuples(st.floats(-50, 700), st.floats(-50, 420))


def boxes_of(labels, places):
    return {k: (p.x, p.y, p.x + labels[k].width, p.y + labels[k].height) for k, p in places.items()}


def overlap(a, b):
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@settings(max_examples=40, deadline=None)
@given(st.lists(points, max_size=40), st.integers(20, 90))
def test_labels_never_pile_up(anchors, width):
    taken = [(0, 0, 640, 54), (10, 60, 200, 300)]
    labels = [Label(i, anchor, width, 18, 8, i % 3) for i, anchor in enumerate(anchors)]
    placed = list(boxes_of(labels, place_labels(labels, taken, SIZE)).values())
    for i, box in enumerate(placed):
        assert min(box[0], box[1]) >= 0 and box[2] <= SIZE[0] and box[3] <= SIZE[1]
        assert not any(overlap(box, other) for other in placed[:i] + taken)


def test_the_important_label_wins_the_place():
    labels = [Label(key, (320, 180), 600, 300, 4, priority) for key, priority in (("minor", 1), ("major", 2))]
    tight = [Label(label.key, label.anchor, 300, 100, 4, label.priority) for label in labels]
    crowd = [(0, 0, 640, 60), (0, 180, 640, 360), (0, 0, 310, 360)]
    assert "major" in place_labels(tight, crowd, SIZE) and "minor" not in place_labels(tight, crowd, SIZE)


def test_labels_keep_their_slot():
    label = Label("uav0", (320, 180), 60, 18, 8, 1)
    for slot in range(8):
        assert place_labels([label], np.empty((0, 4)), SIZE, {"uav0": slot})["uav0"].slot == slot
