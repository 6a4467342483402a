"""Maps made of keyframes at their optimised poses."""
