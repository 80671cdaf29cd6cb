"""What a page of HTML holds."""

from __future__ import annotations

from html.parser import HTMLParser
from types import SimpleNamespace

# Numbers of a table have seven digits.
SAME_DIGITS = 2e-6


class Page(HTMLParser):
    """Elements of a page in order, each with its attributes and the text directly after it."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.open_labels, self.texts = [], 0, []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.open_labels += tag == "label"
        self.elements.append(SimpleNamespace(tag=tag, attributes=attributes, in_label=self.open_labels > 0, text=""))

    def handle_endtag(self, tag):
        self.open_labels -= tag == "label"

    def handle_data(self, data):
        if self.elements:
            self.elements[-1].text += data

    def all(self, *tags):
        return [element for element in self.elements if element.tag in tags]
