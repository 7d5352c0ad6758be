"""What every combination of signals can tell apart at a station: the table of docs/isolability.md, in Markdown.

python benchmarks/isolability.py [STATION]
"""

import sys

from wetwell.services.reports.isolability_table import signals_markdown
from wetwell.services.stations import find_station

if __name__ == "__main__":
    print(signals_markdown(find_station(*sys.argv[1:2] or ["alpha"])))
