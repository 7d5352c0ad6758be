"""A trial on disk: cases published and sealed, diagnoses by processes of their own, seals opened, scores written.

The folder of a trial holds `plan.json`; `published/case-…/` with station file, recording and `seal.sha256`;
`sealed/case-….json` with the labels; `reports/case-…/` with what the diagnosis wrote, and
`recalibrated/` and `whole_library/` with what it wrote when asked otherwise; `trial.json` and `trial.html`.
Whatever is whole is kept by the next run with the same plan.
"""
