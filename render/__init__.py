"""What a camera of the metric would see: Mitsuba renders the scene through a thin lens, a sensor adds its noise.

Imports `pss` for cameras and shapes, and nothing of `scenes` or `validate`.
"""
