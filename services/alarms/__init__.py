"""The alarms daemon: from verdicts, levels and silence to alarms after ISA-18.2."""
