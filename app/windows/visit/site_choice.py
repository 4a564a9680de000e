"""A search field for an anatomic site of DICOM CID 4029, with the side of the body."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QSignalBlocker, QStringListModel, Qt, Signal, Slot
from PySide6.QtWidgets import QComboBox, QCompleter, QHBoxLayout, QLineEdit, QWidget

from app.theme import set_state
from core.records import AnatomicSite

_SIDES = (("", "Side"), ("left", "Left"), ("right", "Right"))


class SiteChoice(QWidget):
    """Type a part of a site's name, choose it from the list.

    Signals
    -------
    site_changed(object)
        An `AnatomicSite`, or None when the field was emptied.
    """

    site_changed = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._site: AnatomicSite | None = None
        self._by_name: dict[str, AnatomicSite] = {}
        self.edit = QLineEdit()
        self.edit.setObjectName("site_search")
        self.edit.setPlaceholderText("Anatomic site: type to search")
        self.side = QComboBox()
        self.side.setObjectName("site_side")
        for key, text in _SIDES:
            self.side.addItem(text, key)
        self.side.setFixedWidth(96)
        self.side.activated.connect(self._on_side)
        self._completer: QCompleter | None = None
        self.edit.textEdited.connect(self._on_typed)
        self.edit.editingFinished.connect(self._on_finished)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        row.addWidget(self.edit, 1)
        row.addWidget(self.side)

    def site(self) -> AnatomicSite | None:
        """The site chosen."""
        return self._site

    def set_site(self, site: AnatomicSite | None) -> None:
        """Show a site without telling."""
        self._site = site
        with QSignalBlocker(self.side), QSignalBlocker(self.edit):
            if not self.edit.hasFocus():
                self.edit.setText("" if site is None else _name(site))
                self.edit.setCursorPosition(0)
            self.side.setCurrentIndex(self.side.findData("" if site is None else site.laterality))
        self.side.setEnabled(site is not None)
        set_state(self.edit, "invalid", "false")

    def _load(self) -> None:
        if self._completer is not None:
            return
        from core.records.sites import skin_sites

        self._by_name = {_name(site): site for site in skin_sites()}
        completer = QCompleter(self)
        completer.setModel(QStringListModel(list(self._by_name), completer))
        completer.setCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        completer.setFilterMode(Qt.MatchFlag.MatchContains)
        completer.setMaxVisibleItems(10)
        completer.activated[str].connect(self._choose)
        self._completer = completer
        self.edit.setCompleter(completer)

    @Slot(str)
    def _on_typed(self, text: str) -> None:
        self._load()
        set_state(self.edit, "invalid", "false")

    @Slot(str)
    def _choose(self, name: str) -> None:
        site = self._by_name.get(name)
        if site is not None:
            self._send(replace(site, laterality=str(self.side.currentData())))

    @Slot()
    def _on_finished(self) -> None:
        text = self.edit.text().strip()
        if self._site is not None and text == _name(self._site):
            return
        if not text:
            if self._site is not None:
                self._send(None)
            return
        self._load()
        exact = next((n for n in self._by_name if n.casefold() == text.casefold()), None)
        matches = [n for n in self._by_name if text.casefold() in n.casefold()]
        name = exact or (matches[0] if len(matches) == 1 else None)
        if name is not None:
            self._choose(name)
        else:
            set_state(self.edit, "invalid", "true")
            self.edit.setToolTip("Choose a site from the list.")

    @Slot(int)
    def _on_side(self, index: int) -> None:
        if self._site is not None:
            self._send(replace(self._site, laterality=str(self.side.itemData(index))))

    def _send(self, site: AnatomicSite | None) -> None:
        if site != self._site:
            self._site = site
            with QSignalBlocker(self.edit):
                self.edit.setText("" if site is None else _name(site))
                self.edit.setCursorPosition(0)
            self.side.setEnabled(site is not None)
            self.site_changed.emit(site)


def _name(site: AnatomicSite) -> str:
    return replace(site, laterality="").name
