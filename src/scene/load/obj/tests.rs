//! OBJ text and what becomes of it.
use super::*;
use crate::scene::load::material::Materials;

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";

fn read(text: &str) -> Result<ObjFile<'static>> {
    parse(Path::new("a.obj"), format!("{SQUARE}{text}").as_bytes(), Numbering::Shared, &mut Library::default())
}

fn error(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

#[test]
fn polygons_become_fans_and_negative_indices_count_back() {
    let quad = read("f -4 -3 -2 -1").unwrap();
    assert_eq!(quad.parts[0].mesh.indices, [0, 1, 2, 0, 2, 3]);
    assert_eq!(quad.parts[0].mesh.positions[..2], [[0.0; 3], [1.0, 0.0, 0.0]]);
    let penta = read("v 0.5 2 0\nf 1 2 3 5 4").unwrap();
    assert_eq!(penta.parts[0].mesh.indices.len(), 9);
    let marked = parse(
        Path::new("a.obj"),
        format!("\u{feff}{SQUARE}f 1 2 4").as_bytes(),
        Numbering::Shared,
        &mut Library::default(),
    );
    assert_eq!(marked.unwrap().parts[0].mesh.indices.len(), 3, "a byte order mark is no part of the first line");
    assert!(read("l 1 2\np 1").unwrap().parts.iter().all(|m| m.mesh.indices.is_empty()));
}

#[test]
fn faces_without_area_for_want_of_corners_are_counted() {
    let warnings = |text: &str| {
        let mut library = Library::default();
        let file =
            parse(Path::new("a.obj"), format!("{SQUARE}{text}").as_bytes(), Numbering::Shared, &mut library).unwrap();
        assert_eq!(file.parts.iter().map(|m| m.mesh.indices.len()).sum::<usize>(), 3, "the whole face is kept");
        library.warnings
    };
    let said = "a.obj: faces repaired: 2 of fewer than three corners dropped, the first in line 11";
    assert_eq!(warnings("f 1 2 3\nf 1 2\n\nf -1"), [said]);
    assert_eq!(warnings("l 1 2\nf 1 2 3\np 1"), Vec::<String>::new(), "lines and points are no faces");
}

#[test]
fn corners_with_and_without_normals_stay_apart() {
    let file = read("o box\nf 1//1 2//1 3//1\nf 1 3 4\nf 1/1/1 2/2/1 3/3/1\nf 1/1 2 3").unwrap();
    let shape: Vec<_> = file.parts.iter().map(|m| (m.name.as_str(), m.mesh.normals.len(), m.mesh.uvs.len())).collect();
    assert_eq!(shape, [("box", 3, 0), ("box", 0, 0), ("box", 3, 3), ("box", 0, 0)]);
}

#[test]
fn lines_may_continue_and_carry_colours_or_foreign_letters() {
    let bytes = [SQUARE.as_bytes(), b"# caf\xe9\nv 9 9 9 1 0 0\nf 1 2 \\\n 3\n"].concat();
    let file = parse(Path::new("a.obj"), &bytes[..], Numbering::Shared, &mut Library::default()).unwrap();
    assert_eq!(file.parts[0].mesh.indices.len(), 3);
}

#[test]
fn vertices_have_the_colours_behind_their_positions() {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    let colours = "v 0 1 0 1 0.5 0\nv 0 2 0 1 0 0 1\nv 1 2 0 0 0 1\nf 1 4 5\nf 5 6 4\n";
    let mut library = Library::default();
    let mut parts = |text: &str| {
        let file = parse(Path::new("a.obj"), text.as_bytes(), Numbering::Shared, &mut library).unwrap();
        let albedo = |part: &Part| library.materials.list[part.material as usize].base_color[0];
        file.parts.iter().map(|p| (p.mesh.positions.clone(), p.mesh.colors.clone(), albedo(p))).collect::<Vec<_>>()
    };
    let all = parts(&format!("{square}{colours}o far\nf 1 2 3\n"));
    let (positions, colors, seen_in) = &all[0];
    assert_eq!((positions.len(), colors.len(), *seen_in), (6, 6, 1.0));
    let of = |position: [f32; 3]| colors[positions.iter().position(|p| *p == position).unwrap()];
    assert_eq!([of([1.0, 0.0, 0.0]), of([0.0; 3])], [[1.0; 4]; 2], "those above the first colour are white");
    let [r, g, b, a] = of([0.0, 1.0, 0.0]);
    assert!(r == 1.0 && (g - 0.214).abs() < 1e-3 && b == 0.0 && a == 1.0, "sRGB: {g}");
    assert_eq!(of([0.0, 2.0, 0.0]), [1.0, 0.0, 0.0, 1.0], "before an alpha");
    assert!(all[1].1.is_empty() && all[1].2 == 0.6, "an object without colours");
    for others in ["v 0 1 0 255 128 0", "v 0 1 0 0 0 -1", "v 0 1 0 0 0 1 1 0 0"] {
        let all = parts(&format!("{square}{}", colours.replace("v 0 1 0 1 0.5 0", others)));
        let has_colors = others.split(' ').count() > 8;
        assert_eq!((!all[0].1.is_empty(), all[0].2), (has_colors, if has_colors { 1.0 } else { 0.6 }), "{others}");
    }
    assert!(parts(square)[0].1.is_empty() && parts(square)[0].2 == 0.6, "control: without colours grey");
    let worn = parts(&format!("{square}usemtl nothing\n{colours}"));
    assert_eq!(worn.iter().map(|part| part.2).collect::<Vec<_>>(), [1.0], "as if nothing were worn");
}

#[test]
fn mistakes_name_their_line() {
    assert_eq!(
        error("f 1 2 5"),
        "a.obj, line 10: the face uses vertex 5, but 4 are defined above it: export the file again"
    );
    assert!(error("f 1/9 2/9 3/9").contains("line 10: the face uses texture coordinate 9, but 4"));
    assert!(error("f 1//2 2//2 3//2").contains("normal 2, but 1"));
    assert!(error("\n\nf 1 2 -5").contains("line 12: the face uses vertex -5"));
    assert!(error("f 1 0 2").contains("vertex 0"));
    assert!(error("f 1 2 6148914691236517205").contains("vertex 6148914691236517205"));
    assert!(error("f 1 2 x").contains("line 10"));
    assert!(error("f -9223372036854775808 1 2").contains("is no vertex of a face"));
    assert!(error("f").contains("line 10"));
    assert!(error("v 1 2").contains("line 10: a vertex needs three numbers"));
    assert!(read("f 1 2 3").is_ok(), "control");
}

#[test]
fn tables_stand_in_for_materials_and_unknown_ones_are_grey() {
    let mut library = Library::default();
    let red = library.materials.push("red", Materials::plain([1.0, 0.0, 0.0]));
    library.tables.insert("red".into(), red);
    let text = format!("mtllib none.mtl\n{SQUARE}usemtl red\nf 1 2 3\nusemtl what\nf 1 2 3");
    let file = parse(Path::new("a.obj"), text.as_bytes(), Numbering::Shared, &mut library).unwrap();
    assert_eq!([0, 1].map(|i: usize| file.parts[i].material), [red, library.grey()]);
    let said = file.grey.unwrap();
    assert!(said.ends_with("defined nowhere: what (no such library: none.mtl)"), "{said}");
}

/// Names are looked up where they are used.
#[test]
fn grey_for_materials_that_a_later_library_defines_is_told() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.mtl"), "newmtl red\nKd 1 0 0").unwrap();
    let text = format!("{SQUARE}usemtl red\nmtllib a.mtl\nf 1 2 3");
    let file =
        parse(&folder.path().join("x.obj"), text.as_bytes(), Numbering::Shared, &mut Library::default()).unwrap();
    let said = file.grey.unwrap();
    assert!(said.ends_with("defined nowhere, or only below their use: red"), "{said}");
}

#[test]
fn statements_may_lack_a_second_coordinate_and_end_in_a_comment() {
    let mesh = &read("vt 0.5 # half\nvt 0.25\nf 1/5 2/6 3/1 # one face").unwrap().parts[0].mesh;
    assert_eq!((mesh.indices.len(), &mesh.uvs[..2]), (3, &[[0.5, 0.0], [0.25, 0.0]][..]));
    // A comment of one word is no weight, and one that ends in a folder takes no line with it.
    let mesh = &read("v 0 0 7 #5\n# from D:\\work\\\nv 0 0 8\nf 5 6 1").unwrap().parts[0].mesh;
    assert_eq!(mesh.positions[..2], [[0.0, 0.0, 7.0], [0.0, 0.0, 8.0]]);
}

#[test]
fn several_libraries_and_names_with_spaces() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("one a.mtl"), "newmtl a\nKd 1 0 0").unwrap();
    std::fs::write(dir.path().join("two.mtl"), "newmtl b c\nKd 0 1 0").unwrap();
    let text = format!("mtllib one a.mtl two.mtl\n{SQUARE}usemtl b c\nf 1 2 3\nusemtl a\nf 1 2 3");
    let mut library = Library::default();
    let file = parse(&dir.path().join("x.obj"), text.as_bytes(), Numbering::Shared, &mut library).unwrap();
    let colors: Vec<_> = file.parts.iter().map(|p| library.materials.list[p.material as usize].base_color).collect();
    assert_eq!((colors, library.warnings.len()), (vec![[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], 0));
}
