"""The third plant that stands for reality: elastic water columns, induction machines, a PLC with a scan of its own.

It shares no equation, no form of an effect, no drawing of stations, no weather and no noise with the other two.
"""
