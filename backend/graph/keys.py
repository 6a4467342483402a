"""Keys of keyframes: plain numbers, or symbols as GTSAM packs them into 64 bits."""

_INDEX_BITS, _LABEL_BITS = 48, 56
LARGEST = 2**63 - 1


def chain_of(key: int) -> int:
    """What keys of one trajectory have in common: 0 for plain numbers, else the symbol's letter and label.

    GTSAM's ``Symbol`` keeps a letter in the highest 8 bits, its ``LabeledSymbol`` a label in the next 8.
    """
    return key >> _INDEX_BITS


def key_name(key: int) -> str:
    """A key as people write it: ``x12`` for a symbol, ``xA12`` for a labelled one, else the number."""
    letter, label = chr(key >> _LABEL_BITS), chr(key >> _INDEX_BITS & 0xFF)
    if not (letter.isascii() and letter.isalpha()) or not (label == "\0" or (label.isascii() and label.isalnum())):
        return str(key)
    return f"{letter}{label.strip(chr(0))}{key & (1 << _INDEX_BITS) - 1}"
