"""The comparison by which CI finds that a picture of the gallery is not what the book shows."""

import importlib.machinery
import importlib.util
import re

import pytest
from conftest import PROJECT

Image = pytest.importorskip("PIL.Image")
ImageChops = pytest.importorskip("PIL.ImageChops")


@pytest.fixture(scope="module")
def pictures():
    """The script that takes the gallery's pictures over."""
    loader = importlib.machinery.SourceFileLoader("pictures", str(PROJECT / "scripts/pictures"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("pictures", loader))
    loader.exec_module(module)
    return module


def test_no_picture_passes_for_another_nor_a_sheet_of_one_colour(pictures):
    folder = PROJECT / "docs/images"
    names = re.findall(r"\]\(images/([^)]+)\)", (PROJECT / "docs/gallery.md").read_text())
    book = {name: Image.open(folder / name).convert("RGB") for name in names}
    assert len(book) >= 10
    for name, ours in book.items():
        # A few pixels that lie elsewhere make no difference.
        moved = ImageChops.offset(ours, 1, 1)
        assert pictures.apart(ours, moved) < pictures.APART, name
        for other, theirs in book.items():
            if other != name and theirs.size == ours.size:
                assert pictures.apart(ours, theirs) > 1.5 * pictures.APART, (name, other)
        for colour in {*(color for _, color in sorted(ours.getcolors(1 << 24))[-3:]), (0, 0, 0), (255, 255, 255)}:
            sheet = Image.new("RGB", ours.size, colour)
            assert pictures.apart(ours, sheet) > 1.5 * pictures.APART, (name, colour)
