# SPDX-License-Identifier: GPL-3.0-or-later
"""The 60 skin and 22 skull landmarks, after Farkas 1994; sides are the subject's own."""


def _both(names: str) -> tuple[str, ...]:
    return tuple(name + side for name in names.split() for side in ("_l", "_r"))


SKIN = (
    *"v g op tr n se prn sn gn pg sl ls li sto".split(),
    *_both("eu ft zy go t en ex ps pi or os sci al ac sbal ch cph sa sba pra pa obs obi"),
)
SKULL = (*"v g op n rhi ans sl pg".split(), *_both("eu ft zy go or os po"))

#: Skull landmark -> the skin landmark it is tied to by a tissue-depth vector (Kähler 2002, 5.2). ``rhi`` has no skin
#: landmark of its own: it pairs with the nasal bridge, halfway from ``se`` to ``prn``.
SKIN_OF_SKULL = {
    **{name: name for name in SKULL if name in SKIN},
    "ans": "sn",
    "po_l": "t_l",
    "po_r": "t_r",
}

LABELS = {
    "v": "vertex, top of the head",
    "g": "glabella, between the brows",
    "op": "opisthocranion, back of the head",
    "tr": "trichion, hairline",
    "n": "nasion, root of the nose",
    "se": "sellion, deepest point of the nose root",
    "prn": "pronasale, tip of the nose",
    "sn": "subnasale, where the columella meets the lip",
    "gn": "gnathion, lowest point of the chin",
    "pg": "pogonion, foremost point of the chin",
    "sl": "sublabiale, crease above the chin",
    "ls": "labiale superius, top of the upper lip's red",
    "li": "labiale inferius, bottom of the lower lip's red",
    "sto": "stomion, middle of the mouth line",
    "eu": "eurion, widest point of the head",
    "ft": "frontotemporale, beside the forehead",
    "zy": "zygion, widest point of the cheekbone",
    "go": "gonion, jaw angle",
    "t": "tragion, notch above the tragus",
    "en": "endocanthion, inner corner of the eye",
    "ex": "exocanthion, outer corner of the eye",
    "ps": "palpebrale superius, middle of the upper lid's edge",
    "pi": "palpebrale inferius, middle of the lower lid's edge",
    "or": "orbitale, lower rim of the orbit",
    "os": "orbitale superius, upper rim of the orbit",
    "sci": "superciliare, top of the brow",
    "al": "alare, widest point of the nose wing",
    "ac": "alar curvature, where the wing meets the cheek",
    "sbal": "subalare, where the wing meets the upper lip",
    "ch": "cheilion, corner of the mouth",
    "cph": "crista philtri, peak of the upper lip",
    "sa": "superaurale, top of the ear",
    "sba": "subaurale, bottom of the ear lobe",
    "pra": "preaurale, front of the ear",
    "pa": "postaurale, back of the ear",
    "obs": "otobasion superius, upper root of the ear",
    "obi": "otobasion inferius, lower root of the ear",
}


def label(name: str) -> str:
    """``ch_l`` -> ``cheilion, corner of the mouth (subject's left)``."""
    base, _, side = name.partition("_")
    return LABELS[base] + {"l": " (subject's left)", "r": " (subject's right)", "": ""}[side]


def mirrored(name: str) -> str:
    """The landmark of the other side; a midline landmark is its own mirror."""
    return {"_l": name[:-2] + "_r", "_r": name[:-2] + "_l"}.get(name[-2:], name)
