"""Lays a visit report out on A4 pages with reportlab."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any, BinaryIO

from reportlab import rl_config
from reportlab.lib.units import mm
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import (
    BaseDocTemplate,
    CondPageBreak,
    Flowable,
    Frame,
    Image,
    KeepTogether,
    PageTemplate,
    Spacer,
    Table,
)

from core.exchange import report_words as say
from core.exchange.fonts import BOLD, REGULAR, printable, register_pdf_fonts
from core.exchange.pictures import jpeg_bytes
from core.exchange.report_data import LesionAtVisit, LesionEntry, VisitReport
from core.exchange.report_flowables import BodyMap, NumberDisc, PictureBox, PictureRow
from core.exchange.report_style import (
    AMBER,
    CONTENT,
    GREY,
    INK,
    LINE,
    MARGIN,
    PAGE_HEIGHT,
    PAGE_WIDTH,
    PALE,
    TEAL,
    TEAL_PALE,
    labelled,
    words,
)
from core.records.images import shown_image
from core.records.records import DermoscopicImage
from core.records.store import ClinicStore

DISCLAIMER = "GeoDerm measures and relocates; it does not diagnose."
_FIRST_TOP, _NEXT_TOP, _BOTTOM = 24 * mm, 21 * mm, 19 * mm
_NO_PADDING = [
    (name, (0, 0), (-1, -1), 0) for name in ("LEFTPADDING", "RIGHTPADDING", "TOPPADDING", "BOTTOMPADDING")
]
# A cell without text draws in the table's font: without this it would be Helvetica, which is not embedded.
_CELL_FONT = ("FONTNAME", (0, 0), (-1, -1), REGULAR)
_AT = {"this visit": "this visit", "previous visit": "the previous visit"}
_OPEN_STATUSES = ("found", "predicted", "ambiguous", "refused")


def build_pdf(store: ClinicStore, report: VisitReport, out: BinaryIO, body_map: bytes | None) -> None:
    """Write the report into a stream."""
    register_pdf_fonts()
    rl_config.useA85 = 0  # pictures as plain binary: smaller and much faster
    document = BaseDocTemplate(
        out,
        pagesize=(PAGE_WIDTH, PAGE_HEIGHT),
        title="GeoDerm visit report",
        author="GeoDerm",
        subject="Skin lesions at one visit",
        creator="GeoDerm",
        lang="en",
        invariant=1,
        initialFontName=REGULAR,
    )

    def frame(top: float) -> Any:
        return Frame(
            MARGIN, _BOTTOM, CONTENT, PAGE_HEIGHT - top - _BOTTOM,
            leftPadding=0, rightPadding=0, topPadding=0, bottomPadding=0,
        )  # fmt: skip

    document.addPageTemplates(
        [
            PageTemplate(
                "first", [frame(_FIRST_TOP)], onPage=_first_header(report), autoNextPageTemplate="next"
            ),
            PageTemplate("next", [frame(_NEXT_TOP)], onPage=_next_header(report)),
        ]
    )
    story = [*_patient_part(report), *_map_part(report, body_map), *_summary_part(report)]
    story += _lesions_part(store, report)
    document.build(story, canvasmaker=_numbered_canvas(report))


# ---------------------------------------------------------------- every page


def _first_header(report: VisitReport) -> Callable[[Any, Any], None]:
    def draw(canvas: Any, _document: Any) -> None:
        top = PAGE_HEIGHT
        canvas.setFillColor(TEAL)
        canvas.rect(0, top - 3 * mm, PAGE_WIDTH, 3 * mm, stroke=0, fill=1)
        canvas.setFont(BOLD, 13)
        canvas.drawString(MARGIN, top - 15 * mm, "GeoDerm")
        canvas.setFillColor(GREY)
        canvas.setFont(REGULAR, 8.4)
        canvas.drawRightString(
            PAGE_WIDTH - MARGIN, top - 15 * mm, _fitted(report.clinic_name, REGULAR, 8.4, CONTENT * 0.7)
        )

    return draw


def _next_header(report: VisitReport) -> Callable[[Any, Any], None]:
    def draw(canvas: Any, _document: Any) -> None:
        y = PAGE_HEIGHT - 12 * mm
        canvas.setFont(BOLD, 8)
        canvas.setFillColor(INK)
        patient = report.patient
        facts = [f"born {say.day(patient.birth_date)}" if patient.birth_date else ""]
        facts += [f"No. {patient.clinic_number}" if patient.clinic_number else ""]
        facts += [f"visit {report.visit.number}, {say.day(report.visit.started_at)}"]
        line = _fitted("   ·   ".join(fact for fact in facts if fact), REGULAR, 7.4, CONTENT * 0.7)
        room = CONTENT - stringWidth(line, REGULAR, 7.4) - 6 * mm
        canvas.drawString(MARGIN, y, _fitted(patient.full_name, BOLD, 8, room))
        canvas.setFillColor(GREY)
        canvas.setFont(REGULAR, 7.4)
        canvas.drawRightString(PAGE_WIDTH - MARGIN, y, line)
        canvas.setStrokeColor(LINE)
        canvas.setLineWidth(0.6)
        canvas.line(MARGIN, y - 3 * mm, PAGE_WIDTH - MARGIN, y - 3 * mm)

    return draw


def _numbered_canvas(report: VisitReport) -> type[Any]:
    """A canvas that knows the number of pages when it writes the footers."""

    class NumberedCanvas(Canvas):  # type: ignore[misc]
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            self._pages: list[dict[str, Any]] = []

        def showPage(self) -> None:
            self._pages.append(dict(self.__dict__))
            self._startPage()

        def save(self) -> None:
            for number, page in enumerate(self._pages, start=1):
                self.__dict__.update(page)
                _draw_footer(self, report, number, len(self._pages))
                super().showPage()
            super().save()

    return NumberedCanvas


def _draw_footer(canvas: Any, report: VisitReport, number: int, total: int) -> None:
    y = 10.5 * mm
    canvas.setStrokeColor(LINE)
    canvas.setLineWidth(0.6)
    canvas.line(MARGIN, y + 4.2 * mm, PAGE_WIDTH - MARGIN, y + 4.2 * mm)
    canvas.setFillColor(GREY)
    canvas.setFont(REGULAR, 6.9)
    canvas.drawString(MARGIN, y, DISCLAIMER)
    author = f"Created {say.day(report.created_at)} by {report.created_by}"
    right = f"Page {number} of {total}"
    canvas.drawRightString(PAGE_WIDTH - MARGIN, y, right)
    room = CONTENT - 150 * mm
    canvas.drawRightString(PAGE_WIDTH - MARGIN - 24 * mm, y, _fitted(author, REGULAR, 6.9, room + 55 * mm))


def _fitted(text: str, font: str, size: float, width: float) -> str:
    """One line of text, cut with an ellipsis if it is wider than ``width``."""
    text = printable(text)
    if stringWidth(text, font, size) <= width:
        return text
    while text and stringWidth(text + "…", font, size) > width:
        text = text[:-1]
    return text.rstrip() + "…"


# ---------------------------------------------------------------- first page


def _patient_part(report: VisitReport) -> list[Flowable]:
    patient, visit = report.patient, report.visit
    age = patient.age_on(visit.started_at.date())
    born = say.day(patient.birth_date) + (f"  ({age} years)" if age is not None else "")
    previous = say.day(report.previous.started_at) if report.previous else "None, this is the first"
    fields = [
        ("Date of birth", born),
        ("Sex", say.SEX_WORDS[patient.sex]),
        ("Clinic number", patient.clinic_number or say.NOTHING),
        (
            "Visit",
            f"No. {visit.number}, {say.day(visit.started_at)}" + ("" if visit.closed_at else " (open)"),
        ),
        ("Doctor", report.doctor or say.NOTHING),
        ("Previous visit", previous),
    ]
    cells = [[words(label, "label"), words(value, "value")] for label, value in fields]
    width = (CONTENT - 10 * mm) / 3
    grid = Table([cells[:3], cells[3:]], colWidths=[width] * 3)
    grid.setStyle(
        [
            _CELL_FONT,
            *_NO_PADDING,
            ("VALIGN", (0, 0), (-1, -1), "TOP"),
            ("TOPPADDING", (0, 0), (-1, -1), 2.6 * mm),
            ("RIGHTPADDING", (0, 0), (-1, -1), 3 * mm),
        ]
    )
    card = Table([[words(patient.full_name, "name")], [grid]], colWidths=[CONTENT])
    card.setStyle(
        [
            _CELL_FONT,
            *_NO_PADDING,
            ("BACKGROUND", (0, 0), (-1, -1), PALE),
            ("LINEBEFORE", (0, 0), (0, -1), 2.2, TEAL),
            ("LEFTPADDING", (0, 0), (-1, -1), 5 * mm),
            ("RIGHTPADDING", (0, 0), (-1, -1), 5 * mm),
            ("TOPPADDING", (0, 0), (0, 0), 3.6 * mm),
            ("BOTTOMPADDING", (0, -1), (-1, -1), 3.8 * mm),
        ]
    )
    parts: list[Flowable] = [words("Visit report", "title"), Spacer(0, 3 * mm), card, Spacer(0, 5 * mm)]
    if visit.note:
        parts += [words("Notes of the visit", "section"), words(visit.note), Spacer(0, 5 * mm)]
    return parts


def _map_part(report: VisitReport, body_map: bytes | None) -> list[Flowable]:
    title = words("Body map", "section")
    if body_map is not None:
        picture = shown_image(body_map, 2000)
        scale = min(CONTENT / picture.width, 150 * mm / picture.height)
        image = Image(
            io.BytesIO(jpeg_bytes(picture)), picture.width * scale, picture.height * scale, hAlign="CENTER"
        )
        return [KeepTogether([title, image]), Spacer(0, 5 * mm)]
    if not report.views:
        note = words("No body photo was taken at this visit.", "small")
        return [KeepTogether([title, note]), Spacer(0, 5 * mm)]
    tall = 152 * mm
    columns = min(2, len(report.views))
    gap = 6 * mm
    width = CONTENT if columns == 1 else (CONTENT - gap) / 2
    widths = [CONTENT] if columns == 1 else [width, gap, width]
    tables = []
    for i in range(0, len(report.views), columns):
        views = report.views[i : i + columns]
        maps: list[Any] = [BodyMap(view, width, tall) for view in views]
        captions: list[Any] = [words(view.title, "caption") for view in views]
        if columns == 2:
            maps, captions = [maps[0], "", *maps[1:]], [captions[0], "", *captions[1:]]
            maps += [""] * (3 - len(maps))
            captions += [""] * (3 - len(captions))
        table = Table([maps, captions], colWidths=widths)
        table.setStyle(
            [
                _CELL_FONT,
                *_NO_PADDING,
                ("VALIGN", (0, 0), (-1, -1), "MIDDLE"),
                ("TOPPADDING", (0, 1), (-1, 1), 3),
            ]
        )
        tables.append(table)
    legend = [_legend(report), Spacer(0, 5 * mm)]
    parts: list[Flowable] = [KeepTogether([title, tables[0], *(legend if len(tables) == 1 else [])])]
    for table in tables[1:]:
        parts += [Spacer(0, 3 * mm), table]
    return parts if len(tables) == 1 else [*parts, *legend]


def _legend(report: VisitReport) -> Flowable:
    shown = {mark.number for view in report.views for mark in view.marks}
    absent = [str(e.lesion.number) for e in report.entries if e.lesion.number not in shown]
    waiting = any(not mark.settled for view in report.views for mark in view.marks)
    sentences = []
    if shown and waiting:
        sentences.append(
            "Filled numbers were marked, confirmed or corrected by a doctor; hollow numbers are proposals."
        )
    if absent:
        sentences.append(f"Not on these photos: {', '.join(absent)}.")
    return words(" ".join(sentences), "caption")


# ---------------------------------------------------------------- table


def _summary_part(report: VisitReport) -> list[Flowable]:
    title = words("Lesions", "section")
    if not report.entries:
        return [KeepTogether([title, words("No lesion has been recorded for this patient.", "body")])]
    head = [
        words("No.", "head"),
        words("Anatomic site", "head"),
        words("At this visit", "head"),
        words("95 % within", "headright"),
        words("Size", "headright"),
        words("Dermoscopy", "headright"),
    ]
    rows: list[list[Any]] = [head]
    for entry in report.entries:
        observation = entry.now.observation
        radius = None
        if observation is not None and observation.decision in ("proposed", "confirmed"):
            radius = observation.radius95_m
        rows.append(
            [
                words(str(entry.lesion.number), "strong"),
                words(_site(entry)),
                words(say.finding(entry), color=_finding_colour(entry)),
                words(say.millimetres(radius), "right"),
                words(say.size(None if observation is None else observation.size_mm), "right"),
                words(_image_count(len(entry.now.dermoscopy)), "right"),
            ]
        )
    fixed = [11 * mm, 0.0, 49 * mm, 20 * mm, 17 * mm, 22 * mm]
    fixed[1] = CONTENT - sum(fixed)
    table = Table(rows, colWidths=fixed, repeatRows=1)
    table.setStyle(
        [
            _CELL_FONT,
            ("VALIGN", (0, 0), (-1, -1), "TOP"),
            ("LEFTPADDING", (0, 0), (-1, -1), 1.6 * mm),
            ("RIGHTPADDING", (0, 0), (-1, -1), 1.6 * mm),
            ("TOPPADDING", (0, 0), (-1, -1), 1.3 * mm),
            ("BOTTOMPADDING", (0, 0), (-1, -1), 1.5 * mm),
            ("BACKGROUND", (0, 0), (-1, 0), TEAL_PALE),
            ("LINEBELOW", (0, 0), (-1, -1), 0.5, LINE),
        ]
    )
    return [CondPageBreak(45 * mm), title, table]


def _site(entry: LesionEntry) -> str:
    return entry.lesion.site.name if entry.lesion.site is not None else "Site not stated"


def _image_count(count: int) -> str:
    return say.NOTHING if count == 0 else "1 image" if count == 1 else f"{count} images"


def _finding_colour(entry: LesionEntry) -> Any:
    observation = entry.now.observation
    if entry.lesion.state == "removed" or observation is None:
        return GREY
    if observation.decision == "rejected":
        return AMBER
    if observation.decision == "proposed":
        return AMBER if observation.status in _OPEN_STATUSES else GREY
    return TEAL


# ---------------------------------------------------------------- one lesion after the other


def _lesions_part(store: ClinicStore, report: VisitReport) -> list[Flowable]:
    if not report.entries:
        return []
    parts: list[Flowable] = [Spacer(0, 7 * mm), CondPageBreak(95 * mm)]
    for i, entry in enumerate(report.entries):
        block = _lesion_block(store, report, entry)
        if i == 0:
            block.insert(0, words("Lesion by lesion", "section"))
        parts += [KeepTogether(block), *_notes(entry), Spacer(0, 5.5 * mm)]
    return parts


def _lesion_block(store: ClinicStore, report: VisitReport, entry: LesionEntry) -> list[Flowable]:
    observation = entry.now.observation
    settled = observation is None or observation.decision != "proposed"
    bar = Table(
        [
            [
                NumberDisc(entry.lesion.number, filled=settled),
                words(_site(entry), "site"),
                words(say.finding(entry), "chip", color=_finding_colour(entry)),
            ]
        ],
        colWidths=[9 * mm, CONTENT - 67 * mm, 58 * mm],
    )
    bar.setStyle(
        [
            _CELL_FONT,
            *_NO_PADDING,
            ("VALIGN", (0, 0), (-1, -1), "MIDDLE"),
            ("LINEABOVE", (0, 0), (-1, 0), 0.8, TEAL),
            ("TOPPADDING", (0, 0), (-1, -1), 2 * mm),
            ("BOTTOMPADDING", (0, 0), (-1, -1), 1.2 * mm),
            ("RIGHTPADDING", (1, 0), (1, 0), 3 * mm),
        ]
    )
    facts = [("Position", say.position(report, observation))]
    size = None if observation is None else observation.size_mm
    earlier = None if entry.before is None else entry.before.observation
    before = None if earlier is None else earlier.size_mm
    if size is not None or before is not None:
        was = f"  (previous visit: {say.size(before)})" if before is not None else ""
        facts.append(("Size", f"{say.size(size) if size is not None else 'not measured'}{was}"))
    return [bar, _fact_table(facts), Spacer(0, 2 * mm), _pictures(store, entry), Spacer(0, 1.5 * mm)]


def _fact_table(facts: list[tuple[str, str]]) -> Table:
    """Labels in one column, what they say in the other."""
    label_width = 21 * mm
    table = Table(
        [[words(label, "factlabel"), words(value, "fact")] for label, value in facts],
        colWidths=[label_width, CONTENT - label_width],
    )
    table.setStyle(
        [
            _CELL_FONT,
            *_NO_PADDING,
            ("VALIGN", (0, 0), (-1, -1), "TOP"),
            ("BOTTOMPADDING", (0, 0), (-1, -1), 1.2),
        ]
    )
    return table


def _pictures(store: ClinicStore, entry: LesionEntry) -> Flowable:
    gap, pair_gap = 2 * mm, 5 * mm
    side = (CONTENT - 2 * gap - pair_gap) / 4
    now, before = entry.now, entry.before
    photos = [_photo_box(side, now, "this visit", "Not placed on a photo\nat this visit")]
    dermoscopy = [_dermoscopy_box(store, side, now, "this visit")]
    if before is not None:
        gone = "New at this visit" if entry.is_new else "Not placed on a photo\nat the previous visit"
        photos.insert(0, _photo_box(side, before, "previous visit", gone))
        if entry.is_new and not before.dermoscopy:
            dermoscopy.insert(0, PictureBox(side, "Dermoscopy, previous visit", jpeg=None, missing=gone))
        else:
            dermoscopy.insert(0, _dermoscopy_box(store, side, before, "previous visit"))
        return PictureRow([*photos, *dermoscopy], gap, pair_gap)
    if now.context is not None:
        caption = f"Where it is\n{say.day(now.visit.started_at)}"
        photos.insert(0, PictureBox(side, caption, jpeg=now.context.jpeg))
    return PictureRow([*photos, *dermoscopy], gap, pair_gap if len(photos) == 2 else gap)


def _photo_box(side: float, at: LesionAtVisit, which: str, missing: str) -> PictureBox:
    caption = f"Body photo, {which}\n{say.day(at.visit.started_at)}"
    return PictureBox(side, caption, jpeg=None if at.crop is None else at.crop.jpeg, missing=missing)


def _dermoscopy_box(store: ClinicStore, side: float, at: LesionAtVisit, which: str) -> PictureBox:
    images: tuple[DermoscopicImage, ...] = at.dermoscopy
    caption = f"Dermoscopy, {which}\n{say.day(images[-1].added_at if images else at.visit.started_at)}"
    if not images:
        return PictureBox(side, caption, jpeg=None, missing=f"No dermoscopic image\nat {_AT[which]}")
    if len(images) > 1:
        caption += f" (last of {len(images)})"
    picture = shown_image(store.dermoscopy.data(images[-1].id), 500)
    return PictureBox(side, caption, jpeg=jpeg_bytes(picture))


def _notes(entry: LesionEntry) -> list[Flowable]:
    """Notes below the pictures; a long one runs on over as many pages as it needs."""
    notes = []
    if entry.now.observation is not None and entry.now.observation.note:
        notes.append(("Note, this visit", entry.now.observation.note))
    if entry.lesion.note:
        notes.append(("Note, lesion", entry.lesion.note))
    notes += [("Note, dermoscopy", image.note) for image in entry.now.dermoscopy if image.note]
    return [labelled(label, note) for label, note in notes]
