"""Colours of what is seen of a case, the same in pictures and on pages."""

# Of regions, by their numbers; again from the first where there are more. Neighbours differ in lightness, too.
REGIONS = (
    "#e3a791",
    "#f6dfa4",
    "#b8504a",
    "#e9e4d4",
    "#7d6aa8",
    "#6fa98f",
    "#d98b3a",
    "#5b87b5",
    "#c783a8",
    "#8c7a62",
)
# Scales of element size, displacement and strain: matplotlib's viridis, and ColorBrewer's of the names.
VIRIDIS = ("#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725")
YLGNBU = ("#ffffd9", "#edf8b1", "#c7e9b4", "#7fcdbb", "#41b6c4", "#1d91c0", "#225ea8", "#253494", "#081d58")
YLORRD = ("#ffffcc", "#ffeda0", "#fed976", "#feb24c", "#fd8d3c", "#fc4e2a", "#e31a1c", "#bd0026", "#800026")
INK, OUTLINE, FOOTPRINT, HELD = "#111111", "#8c9199", "#e8110f", "#4a5a70"
TOOL = "#7c8794"


def region_colours(count: int) -> list[str]:
    """Return the colours of ``count`` regions."""
    return [REGIONS[number % len(REGIONS)] for number in range(count)]
