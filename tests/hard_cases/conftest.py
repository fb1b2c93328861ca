"""What the tests of hard cases share."""

from support.kernel_place import place as place
