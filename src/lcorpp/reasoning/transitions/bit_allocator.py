"""Compilation, step 2: allocation of the bits of a state, as in register allocation."""

from __future__ import annotations

from collections.abc import Sequence


class BitAllocator:
    """Allocates the lowest free bits of the states of a branch, so that equal components get equal bits.

    A bit is a mask with one set bit; live_mask has all bits in use.
    """

    def __init__(self, bits_of: dict[int, int]) -> None:
        """
        Args:
            bits_of: step -> the bits that it reads last.
        """
        self._bits_of = bits_of
        self.live_mask = sum(bits_of.values())

    def allocate(self, reader: int) -> int:
        """Return a bit that is not in use, for a step that reads it last."""
        bit = ~self.live_mask & (self.live_mask + 1)  # the lowest that is not set
        self.live_mask |= bit
        self._bits_of[reader] = self._bits_of.get(reader, 0) | bit
        return bit

    def release(self, mask: int, reader: int) -> None:
        """Free bits that a step would read last."""
        if mask:
            self.live_mask ^= mask
            self._bits_of[reader] ^= mask

    def split(self, branches: Sequence[range]) -> list[BitAllocator]:
        """Return an allocator for each branch, with the bits that its steps read.

        Args:
            branches: the steps of each.
        """
        largest = max(branches, key=len, default=None)
        allocators = []
        for branch in branches:
            if branch is largest:  # it keeps this allocator, which saves the copy
                allocators.append(self)
                continue
            own = {step: self._bits_of.pop(step) for step in branch if step in self._bits_of}
            allocators.append(BitAllocator(own))
            self.live_mask ^= allocators[-1].live_mask
        return allocators
