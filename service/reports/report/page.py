"""The page: self-contained HTML without a script, made for one sheet of A4."""

from html import escape

from service.reports.figures import figures
from service.reports.report.case import Case
from service.reports.report.style import STYLE
from service.reports.report.tables import estimators_table, events_table, films_table, footer
from service.reports.report.words import facts, headline, shortened, story
from service.runtime.times import day_and_time

POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
"""For the header of the answer and for the page that somebody opens from a bundle."""


def report_page(case: Case, now_ns: int) -> str:
    """The report of an occurrence.

    Parameters
    ----------
    now_ns
        When it is printed: what has come since the alarm is shown up to then.
    """
    evidence = case.evidence
    title, level = escape(headline(evidence)), evidence.alarm.level or "alert"
    bearing = case.bearing
    body = [
        f'<header><h1>{title}</h1><span class="badge {level}">{level.upper()}</span></header>',
        _facts(case, now_ns),
        f'<p class="story">{escape(story(case))}</p>',
        *figures(case),
        estimators_table(bearing) if bearing is not None else "",
        films_table(evidence),
        events_table(case),
        footer(case),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{title}, {escape(evidence.alarm.time)}</title><style>{STYLE}</style></head>"
        f"<body>{''.join(body)}</body></html>\n"
    )


def _facts(case: Case, now_ns: int) -> str:
    pairs = "".join(
        f"<dt>{escape(name)}</dt><dd>{escape(shortened(words))}</dd>"
        for name, words in facts(case, day_and_time(now_ns))
    )
    return f"<dl>{pairs}</dl>"
