use super::*;
use std::io::Write;

/// How numbers are written.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Text,
    Little,
    Big,
}

/// Writes rows of a PLY file in one of its forms.
struct Writer(Form, Vec<u8>);

impl Writer {
    fn new(form: Form, header: &str) -> Self {
        let name = match form {
            Form::Text => "ascii",
            Form::Little => "binary_little_endian",
            Form::Big => "binary_big_endian",
        };
        Self(form, format!("ply\nformat {name} 1.0\ncomment a test\n{header}end_header\n").into_bytes())
    }

    fn float(&mut self, v: f32) {
        match self.0 {
            Form::Text => write!(self.1, "{v} ").unwrap(),
            Form::Little => self.1.extend(v.to_le_bytes()),
            Form::Big => self.1.extend(v.to_be_bytes()),
        }
    }

    fn byte(&mut self, v: u8) {
        match self.0 {
            Form::Text => write!(self.1, "{v} ").unwrap(),
            _ => self.1.push(v),
        }
    }

    fn int(&mut self, v: i32) {
        match self.0 {
            Form::Text => write!(self.1, "{v} ").unwrap(),
            Form::Little => self.1.extend(v.to_le_bytes()),
            Form::Big => self.1.extend(v.to_be_bytes()),
        }
    }

    fn end_row(&mut self) {
        if self.0 == Form::Text {
            self.1.push(b'\n');
        }
    }
}

const HEADER: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float quality\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\n\
    element mark 1\nproperty list uchar float words\nelement face 2\nproperty uchar flags\n\
    property list uchar int vertex_indices\n";

/// A unit square as a quad, and one of its halves as a triangle.
fn square(form: Form) -> Vec<u8> {
    let mut w = Writer::new(form, HEADER);
    for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        [x, y, 0.0, 7.0].into_iter().for_each(|v| w.float(v));
        [255, 188, 0].into_iter().for_each(|v| w.byte(v));
        [x, y].into_iter().for_each(|v| w.float(v));
        w.end_row();
    }
    w.byte(2);
    [1.0, 2.0].into_iter().for_each(|v| w.float(v));
    w.end_row();
    for face in [&[0, 1, 2, 3][..], &[0, 1, 2]] {
        w.byte(9);
        w.byte(face.len() as u8);
        face.iter().for_each(|&i| w.int(i));
        w.end_row();
    }
    w.1
}

fn read(bytes: &[u8], name: &str) -> Result<Mesh> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    Ok(load(&path, Numbering::Shared, &mut Library::default())?.parts.remove(0).mesh.into_owned())
}

fn refusal(bytes: &[u8]) -> String {
    let line = read(bytes, "a.ply").unwrap_err().to_string();
    assert!(!line.contains('\n'), "{line}");
    line
}

fn text(header: &str, rows: &str) -> String {
    format!("ply\nformat ascii 1.0\n{header}end_header\n{rows}")
}

#[test]
fn every_form_is_the_same_mesh() {
    let packed = |bytes: &[u8]| {
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(bytes).unwrap();
        gzip.finish().unwrap()
    };
    let text = square(Form::Text);
    let windows = String::from_utf8(text.clone()).unwrap().replace('\n', "\r\n").into_bytes();
    let files = [
        (text.clone(), "a.ply"),
        (windows, "a.ply"),
        (square(Form::Little), "a.PLY"),
        (square(Form::Big), "a.ply"),
        (packed(&text), "a.ply.gz"),
        (packed(&square(Form::Big)), "a.ply.gz"),
        ([packed(&text[..100]), packed(&text[100..])].concat(), "a.ply.gz"),
    ];
    for (i, (bytes, name)) in files.iter().enumerate() {
        let mesh = read(bytes, name).unwrap_or_else(|e| panic!("file {i}: {e}"));
        assert_eq!(mesh.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]], "file {i}");
        assert_eq!(mesh.indices, [0, 1, 2, 0, 2, 3, 0, 1, 2], "file {i}");
        assert_eq!(mesh.uvs[2], [1.0, 1.0], "file {i}");
        // Code 188 is about half of the light of code 255.
        let [r, g, b, a] = mesh.colors[0];
        assert!(r == 1.0 && (g - 0.5).abs() < 0.01 && b == 0.0 && a == 1.0, "file {i}: {:?}", mesh.colors[0]);
        assert!(mesh.normals.is_empty(), "file {i}");
    }
}

/// Whatever programs call what is not read, and however often, rows are as long as the header says.
#[test]
fn names_that_are_not_read_may_be_any() {
    let others = ["scalar_Linearity_(0.5)", "Col.001", "#2", "quality", "quality", "x", "unread_3"];
    let more: String = others.iter().map(|name| format!("property float {name}\n")).collect();
    let header = format!(
        "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n{more}\
         element face 1\nproperty list uchar int vertex_indices\n"
    );
    let places = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let row = |p: &[f32; 3]| p.iter().copied().chain([9.0; 7]).collect::<Vec<f32>>();
    let lines: String =
        places.iter().map(|p| row(p).iter().map(|v| format!("{v} ")).collect::<String>() + "\n").collect();
    let mut binary = format!("ply\nformat binary_little_endian 1.0\n{header}end_header\n").into_bytes();
    places.iter().flat_map(row).for_each(|v| binary.extend(v.to_le_bytes()));
    binary.push(3);
    [0u32, 1, 2].iter().for_each(|i| binary.extend(i.to_le_bytes()));
    let latin = text(&header, &format!("{lines}3 0 1 2\n")).replace("1.0\n", "1.0\ncomment Fl?che\n").into_bytes();
    let latin = latin.into_iter().map(|b| if b == b'?' { 0xe4 } else { b }).collect::<Vec<u8>>();
    for (bytes, what) in [(latin, "text"), (binary, "binary")] {
        let mesh = read(&bytes, "a.ply").unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!((mesh.positions, mesh.indices), (places.to_vec(), vec![0, 1, 2]), "{what}");
    }
}

#[test]
fn colors_of_whole_numbers_count_to_255_however_wide_they_are() {
    let header = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty int red\nproperty int green\nproperty short blue\n\
                  element face 1\nproperty list uchar int vertex_indices\n";
    let mesh = read(text(header, "0 0 0 255 0 0\n1 0 0 188 0 0\n0 1 0 0 0 0\n3 0 1 2\n").as_bytes(), "a.ply").unwrap();
    let red: Vec<_> = mesh.colors.iter().map(|c| c[0]).collect();
    assert!(red[0] == 1.0 && (red[1] - 0.5).abs() < 0.01 && red[2] == 0.0, "{red:?}");
}

#[test]
fn strips_keep_their_side() {
    let header = "element vertex 4\nproperty double x\nproperty double y\nproperty double z\nelement tristrips 1\n\
                  property list int int vertex_indices\n";
    let mesh = read(text(header, "0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 0 1 2\n").as_bytes(), "a.ply").unwrap();
    assert_eq!(mesh.indices, [0, 1, 2, 1, 3, 2, 0, 1, 2]);
}

#[test]
fn what_is_wrong_is_one_line() {
    let vertex = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let face = "element face 1\nproperty list uchar uint vertex_indices\n";
    let header = format!("{vertex}{face}");
    let rows = "0 0 0\n1 0 0\n0 1 0\n";
    assert!(read(text(&header, &format!("{rows}3 0 1 2\n")).as_bytes(), "a.ply").is_ok());
    assert!(refusal(text(&header, &format!("{rows}3 0 1 3\n")).as_bytes()).contains("an index of 3, and 3 vertices"));
    assert!(refusal(text(&header, &format!("{rows}3 0 1\n")).as_bytes()).contains("damaged or ends too early"));
    assert!(refusal(text(&header, rows).as_bytes()).contains("ends too early"));
    assert!(refusal(text(vertex, rows).as_bytes()).contains("has no faces"));
    assert!(refusal(text(face, "3 0 1 2\n").as_bytes()).contains("has no vertices"));
    assert!(refusal(text(&header.replace(" z", " w"), rows).as_bytes()).contains("no z"));
    assert!(refusal(b"solid cube\n").contains("is no PLY file"));
    assert!(refusal(b"ply").contains("damaged"));
    let other = refusal(text(&header.replace("vertex_indices", "corners"), &format!("{rows}3 0 1 2\n")).as_bytes());
    assert!(other.contains("no vertex_indices") && !other.contains("OBJ"), "{other}");
    // What no end of a line ends is not read to its end.
    assert!(refusal(format!("ply\n{}", "a".repeat(1 << 21)).as_bytes()).contains("a header of more than 1 MiB"));
    assert!(refusal(text(&header, &"1".repeat((1 << 26) + 2)).as_bytes()).contains("more than 64 MiB in line 10"));
    // Claims that no file holds, of rows with and without properties.
    let huge = header.replace("face 1", "face 4000000000000");
    assert!(refusal(text(&huge, rows).as_bytes()).contains("claims 4000000000000 of \"face\""));
    let empty = format!("element nothing 99999999999999999\n{header}");
    assert!(refusal(text(&empty, rows).as_bytes()).contains("claims"));
}

/// Bytes of a file are changed one at a time: whatever is read then has corners that are there.
#[test]
fn damaged_files_end_in_an_error_or_in_a_mesh() {
    for form in [Form::Text, Form::Little, Form::Big] {
        let whole = square(form);
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 1 << (at % 8);
            if let Ok(mesh) = read(&bytes, "a.ply") {
                assert!(mesh.check().is_ok(), "byte {at}");
            }
        }
        for end in 0..whole.len() {
            let _ = read(&whole[..end], "a.ply");
        }
    }
}

#[test]
fn numbers_of_a_text_may_have_every_form_of_c() {
    let header = "element vertex 4\nproperty float x\nproperty double y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\n";
    let rows = ".5 -.5 1.\n+1 1e1 -2.E-1\n0 0 inf\nnan 0 0\n3 0 1 2\n";
    let mesh = read(text(header, rows).as_bytes(), "a.ply").unwrap();
    assert_eq!(mesh.positions[..3], [[0.5, -0.5, 1.0], [1.0, 10.0, -0.2], [0.0, 0.0, f32::INFINITY]]);
    assert!(mesh.positions[3][0].is_nan());
    for (from, to) in [("+1", "1,5"), ("1e1", "0x1"), ("3 0", "3 0.0")] {
        let (said, word) = (refusal(text(header, &rows.replace(from, to)).as_bytes()), to.trim_start_matches("3 "));
        let line = if word == to { 11 } else { 14 };
        assert!(said.contains(&format!("has \"{word}\" in place of a number of its type in line {line}")), "{said}");
    }
}

#[test]
fn what_faces_have_and_is_not_read_is_named() {
    let vertex = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let face = "element face 1\nproperty list uchar int vertex_indices\n";
    let said = |more: &str, row: &str| {
        let folder = tempfile::tempdir().unwrap();
        let (path, mut library) = (folder.path().join("a.ply"), Library::default());
        std::fs::write(&path, text(&format!("{vertex}{face}{more}"), &format!("0 0 0\n1 0 0\n0 1 0\n{row}\n")))
            .unwrap();
        load(&path, Numbering::Shared, &mut library).unwrap();
        library.warnings
    };
    assert_eq!(said("", "3 0 1 2"), Vec::<String>::new());
    let short = said("", "2 0 1");
    assert!(
        short.len() == 1 && short[0].ends_with("faces repaired: 1 of fewer than three corners dropped"),
        "{short:?}"
    );
    let both = said("property list uchar float texcoord\nproperty uchar red\n", "3 0 1 2 6 0 0 1 0 0 1 255");
    assert!(
        both.len() == 1 && both[0].ends_with("a.ply: not read: texture coordinates of faces, colours of faces"),
        "{both:?}"
    );
}
