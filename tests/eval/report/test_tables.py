"""Tables of texts in three languages."""

from semslam.eval.report.page import SuiteReport, make_suite
from semslam.eval.report.tables import Table, latex_text, to_latex, to_markdown

TABLE = Table("fr1_desk & more", ("method", "ATE"), (("a|b", "4.2 ± 0.1"), ("<c>", "100 %")), ("From x_y.",))


def test_markdown_has_a_row_per_row_and_escapes_its_bars() -> None:
    lines = to_markdown(TABLE).splitlines()
    assert lines[2:6] == ["| method | ATE |", "|---|---:|", "| a\\|b | 4.2 ± 0.1 |", "| <c> | 100 % |"]
    assert lines[-1] == "- From x_y."


def test_latex_escapes_what_is_special_to_it() -> None:
    text = to_latex(TABLE)
    assert r"fr1\_desk \& more. From x\_y." in text
    assert r"a|b & 4.2 $\pm$ 0.1 \\" in text
    assert r"$<$c$>$ & 100 \% \\" in text
    assert latex_text("\\{") == r"\textbackslash{}\{"


def test_html_escapes_its_texts() -> None:
    page = make_suite(SuiteReport("a <suite>", "2 runs", None, (TABLE,), "seeds: [0]"))
    assert "<th>&lt;c&gt;</th>" in page
    assert "<h2>fr1_desk &amp; more</h2>" in page
    assert "<suite>" not in page
