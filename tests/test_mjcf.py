"""MJCF as text: what is edited changes, and not one byte besides."""

import mujoco
import pytest

from joda.scenes.mjcf import MjcfError, Source


def source(tmp_path, text: str | bytes, **files: str) -> Source:
    """A file main.xml, beside it `files` (their names without .xml, '__' for '/')."""
    for name, content in files.items():
        path = tmp_path / f"{name.replace('__', '/')}.xml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    main = tmp_path / "main.xml"
    main.write_bytes(text.encode() if isinstance(text, str) else text)
    return Source(main)


def one(document: Source, tag: str):
    (found,) = (element for element in document.root.walk() if element.tag == tag)
    return found


# --- attributes

SET = {  # a tag: what it is after set(damping="0", name="new")
    "<joint/>": '<joint damping="0" name="new"/>',
    "<joint />": '<joint damping="0" name="new" />',
    "<joint></joint>": '<joint damping="0" name="new"></joint>',
    "<joint name='a' damping='2'/>": '<joint name="new" damping="0"/>',
    '<joint damping = "2"\n  name\t=\t"a" />': '<joint damping="0"\n  name="new" />',
    '<joint\r\n\tname="a"\r\n\taxis="1 0 0"/>': (
        '<joint\r\n\tname="new"\r\n\taxis="1 0 0" damping="0"/>'
    ),
    """<joint name="a > b / damping='7'"/>""": '<joint name="new" damping="0"/>',
    '<joint name="a"\n/>': '<joint name="new" damping="0"\n/>',
    '<joint springdamper="1 1" name="ä/">': '<joint springdamper="1 1" name="new" damping="0">',
}


@pytest.mark.parametrize("tag", SET, ids=range(len(SET)))
def test_attributes_are_set_in_place_or_added_at_the_end(tmp_path, tag):
    around = "<mujoco><!-- <joint/> é -->{}<text/></mujoco>"
    if not tag.endswith(("/>", "</joint>")):
        around = "<mujoco>{}</joint></mujoco>"
    document = source(tmp_path, around.format(tag))
    one(document, "joint").set(damping="0", name="new")
    assert document.render().decode() == around.format(SET[tag])


@pytest.mark.parametrize("value", ["a & b", "<x>", "\"'", "'", '"', "é 抽屉 🚪", "a\tb\nc"])
def test_any_value_reads_back_as_it_was_set(tmp_path, value):
    document = source(tmp_path, "<mujoco><joint name='a'/></mujoco>")
    one(document, "joint").set(name=value)
    again = source(tmp_path, document.render())
    assert one(again, "joint").attributes == {"name": value}


def test_a_comment_in_latin_1_is_kept(tmp_path):
    text = b"<mujoco><!-- 90\xb0 --><joint name='a'/></mujoco>"
    document = source(tmp_path, text)
    one(document, "joint").set(name="b")
    assert document.render() == text.replace(b"'a'", b'"b"')


# --- elements

BODY = "<mujoco>\n  <body>\n    <joint/>\n    <geom/>\n  </body>\n</mujoco>\n"


def test_lines_are_inserted_with_the_neighbours_indentation(tmp_path):
    document = source(tmp_path, BODY)
    one(document, "joint").insert_after("<a>\n  <b/>\n</a>")
    one(document, "body").insert_first("<first/>")
    one(document, "body").insert_last("<last/>")
    assert document.render().decode() == (
        "<mujoco>\n  <body>\n    <first/>\n    <joint/>\n    <a>\n      <b/>\n    </a>\n"
        "    <geom/>\n    <last/>\n  </body>\n</mujoco>\n"
    )


def test_an_element_is_replaced_with_its_indentation(tmp_path):
    document = source(tmp_path, BODY)
    one(document, "joint").replace("<a>\n  <b/>\n</a>")
    assert document.render().decode() == BODY.replace(
        "    <joint/>", "    <a>\n      <b/>\n    </a>"
    )


def test_lines_inserted_into_a_file_with_crlf_end_in_crlf(tmp_path):
    document = source(tmp_path, BODY.replace("\n", "\r\n"))
    one(document, "joint").insert_after("<a>\n</a>")
    text = document.render().decode()
    assert text.count("\n") == text.count("\r\n") == 8


def test_an_inserted_value_with_odd_line_separators_is_not_torn(tmp_path):
    document = source(tmp_path, BODY)
    one(document, "joint").insert_after('<a b="x\x85y\u2028z"/>')
    assert one(source(tmp_path, document.render()), "a").attributes == {"b": "x\x85y\u2028z"}


def test_edits_of_neighbours_without_a_gap_do_not_mix(tmp_path):
    document = source(tmp_path, "<mujoco><joint/><geom/></mujoco>")
    one(document, "joint").insert_after("<a/>")
    one(document, "geom").set(name="g")
    assert document.render().decode() == '<mujoco><joint/>\n<a/><geom name="g"/></mujoco>'


def test_without_edits_the_bytes_are_those_of_the_file(tmp_path):
    text = (
        b"\xef\xbb\xbf<?xml version='1.0'?>\r\n<!-- x --><mujoco a = 'b'>\t<a ></a >\n</mujoco >\n"
    )
    assert source(tmp_path, text).render() == text


@pytest.mark.parametrize("declaration", ["", '<?xml version="1.0" encoding="UTF-8"?>\n'])
def test_a_byte_order_mark_shifts_nothing(tmp_path, declaration):
    text = f"{declaration}<mujoco><!-- é --><joint/></mujoco>".encode("utf-8-sig")
    document = source(tmp_path, text)
    one(document, "joint").set(name="é")
    assert document.render() == text.replace(b"<joint/>", '<joint name="é"/>'.encode())


# --- includes

PART = "<mujocoinclude>\n  <!-- kept -->\n  <body><joint/></body>\n</mujocoinclude>"


def test_an_included_file_that_changes_is_written_out_in_place(tmp_path):
    text = '<mujoco>\n  <include file="part.xml"/>\n  <include file="other.xml"/>\n</mujoco>'
    document = source(tmp_path, text, part=PART, other="<mujoco><asset/></mujoco>")
    one(document, "joint").set(name="j")
    assert document.render().decode() == (
        '<mujoco>\n  <!-- kept -->\n  <body><joint name="j"/></body>\n'
        '  <include file="other.xml"/>\n</mujoco>'
    )
    assert (tmp_path / "part.xml").read_text() == PART


def names(path) -> list[str]:
    model = mujoco.MjModel.from_xml_path(str(path))
    return [model.joint(k).name for k in range(model.njnt)]


def body(name: str, inside: str = "") -> str:
    return f'<body><joint name="{name}"/><geom size="1"/>{inside}</body>'


def include(file: str) -> str:
    return f'<include file="{file}"/>'


def wrap(text: str) -> str:
    return f"<mujoco>{text}</mujoco>"


NESTED = [  # the file in a/, and the folder of the file that it includes
    (wrap(body("a") + include("b.xml")), "a__b"),  # relative to the including file
    (wrap(body("a") + include("a/b.xml")), "a__b"),  # relative to the main file
    (wrap(body("a") + include("c/b.xml")), "a__c__b"),
    (wrap(body("a") + include("c/b.xml")), "c__b"),
]


@pytest.mark.parametrize(("middle", "inner"), NESTED)
@pytest.mark.parametrize("changed", [None, "a", "b"])
@pytest.mark.parametrize("folder", [".", "new", "new/er"])
def test_nested_includes_are_found_from_wherever_the_scene_lies(
    tmp_path, middle, inner, changed, folder
):
    text = wrap(f"<worldbody>{include('a/a.xml')}{body('c')}</worldbody>")
    document = source(tmp_path, text, a__a=middle, **{inner: wrap(body("b"))})
    for element in document.root.walk():
        if changed and element.attributes.get("name") == changed:
            element.set(name="new")
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    document.relocate(tmp_path / folder)
    (tmp_path / folder / "out.xml").write_bytes(document.render())
    expected = ["new" if name == changed else name for name in ("a", "b", "c")]
    assert names(tmp_path / folder / "out.xml") == expected


def test_joints_come_in_the_order_of_the_compiled_model(tmp_path):
    text = wrap(
        "<worldbody><frame>"
        + body("a", f'{body("b")}<frame pos="1 0 0"><joint name="c" type="slide"/></frame>')
        + f"</frame>{include('part.xml')}</worldbody>"
        + f"<worldbody>{body('e')}</worldbody>"
    )
    document = source(
        tmp_path, text, part=wrap("<body><freejoint/><geom size='1'/></body>" + body("d"))
    )
    written = [element.attributes["name"] for _, element in document.joints() if element.attributes]
    compiled = [name for name in names(tmp_path / "main.xml") if name]
    assert written == compiled == ["a", "c", "b", "d", "e"]


# --- what cannot be edited


def test_broken_xml_is_refused_with_the_line(tmp_path):
    with pytest.raises(MjcfError, match=r"main\.xml: mismatched tag: line 2, column 2"):
        source(tmp_path, "<mujoco>\n</muj>")


def test_another_root_element_is_refused(tmp_path):
    with pytest.raises(MjcfError, match="the root element is <robot>, not <mujoco>"):
        source(tmp_path, "<robot/>")


def test_a_missing_include_is_refused(tmp_path):
    with pytest.raises(MjcfError, match=r"main\.xml: the included file x/y\.xml does not exist"):
        source(tmp_path, wrap(include("x/y.xml")))
