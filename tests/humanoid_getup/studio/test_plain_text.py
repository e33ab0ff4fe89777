"""Text of a log is shown, never interpreted."""

import html
import re

from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.studio.plain_text import escape, make_block


@given(st.text())
def test_all_punctuation_is_escaped_and_nothing_else_changes(text: str):
    shown = escape(text)
    assert re.sub(r"\\(.)", r"\1", shown) == " ".join(text.split())
    assert not re.search(r"[!-/:-@\[-`{-~]", re.sub(r"\\.", "", shown))


TAGS = re.compile(r'<pre><code style="[a-z-: ;]+">|</code></pre>|<span style="[a-z-: ]+">|</span>')


@given(st.text() | st.sampled_from(["--a <b>", "-x\n-y !", "a --b=c&d"]))
def test_a_block_is_one_piece_of_html_without_pictures(text: str):
    inside = TAGS.sub("", make_block(text))
    assert html.unescape(inside) == html.unescape(html.escape(text))
    assert not set(inside) & set("<>!\n")
