//! A block of an OBJ file by itself: numbers are read, but what they refer to may lie in blocks before it.
use super::blocks::Statements;
use crate::error::Checked;
use crate::math::srgb::linear_from_srgb;

/// Indices as a face writes them of a position, a texture coordinate and a normal, or [`NO_INDEX`].
pub type Indices = [i64; 3];
/// In place of a texture coordinate or normal that a corner does not have.
pub const NO_INDEX: i64 = i64::MIN;

/// What the statements of a block hold.
#[derive(Default)]
pub struct ObjBlock {
    /// Values of `v`, `vt` and `vn`.
    pub positions: Vec<[f32; 3]>,
    /// Linear colours behind the positions, [`NO_COLOR`] where there is none; empty if there are none at all.
    pub colors: Vec<[f32; 3]>,
    /// Whether there are numbers in the place of colours that are none.
    pub has_others: bool,
    /// Texture coordinates.
    pub uvs: Vec<[f32; 2]>,
    /// Normals.
    pub normals: Vec<[f32; 3]>,
    /// Corners of all faces.
    pub corners: Vec<Indices>,
    /// All other statements, in the order of the file, each with its line in the block, from 1.
    pub statements: Vec<(u32, Statement)>,
    /// What is wrong with the statement at which reading ended, and its line.
    pub mistake: Option<(u32, String)>,
    /// Number of lines.
    pub lines: u32,
}

/// A statement whose order counts.
pub enum Statement {
    /// `f`: the number of its corners, and how many positions, texture coordinates and normals are defined above it in the block.
    Face(u32, [u32; 3]),
    /// `o` or `g`.
    Name(String),
    /// `usemtl`.
    Wear(String),
    /// `mtllib`.
    Libraries(String),
    /// A curved surface or curve, which is not read: its key.
    Curved(&'static str),
}

impl ObjBlock {
    /// Reads a block up to the first mistake.
    pub fn parse(text: &[u8]) -> Self {
        let text = String::from_utf8_lossy(text);
        let (mut block, mut statements) = (Self::default(), Statements::of(&text));
        for (line, text) in &mut statements {
            if let Err(what) = block.statement(line, &text) {
                block.mistake = Some((line, what));
                break;
            }
        }
        block.lines = statements.lines;
        block
    }

    /// Statements that a path tracer does not need, such as lines and points, are skipped.
    fn statement(&mut self, line: u32, text: &str) -> Checked {
        let text = text.trim_ascii_start();
        let (key, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
        let name = || rest.trim().to_owned();
        let statement = match key {
            "v" => return self.vertex(rest),
            "vt" => {
                let what = "a texture coordinate needs one or two numbers after vt";
                let [u] = numbers(rest, what)?;
                let second = rest.split_ascii_whitespace().nth(1).filter(|word| !word.starts_with('#'));
                let [v] = second.map_or(Ok([0.0]), |word| numbers(word, what))?;
                self.uvs.push([u, v]);
                return Ok(());
            }
            "vn" => {
                self.normals.push(numbers(rest, "a normal needs three numbers after vn")?);
                return Ok(());
            }
            "f" => self.face(rest)?,
            "o" | "g" => Statement::Name(name()),
            "usemtl" if rest.trim().is_empty() => return Err(mend("usemtl names no material")),
            "usemtl" => Statement::Wear(name()),
            "mtllib" => Statement::Libraries(name()),
            "surf" => Statement::Curved("surf"),
            "curv" => Statement::Curved("curv"),
            _ => return Ok(()),
        };
        self.statements.push((line, statement));
        Ok(())
    }

    /// A fourth number is a weight that the others are divided by; six or seven begin with a position and an sRGB colour from 0 to 1. More
    /// mean nothing here.
    fn vertex(&mut self, rest: &str) -> Checked {
        let what = "a vertex needs three numbers after v";
        let rest = rest.split('#').next().unwrap_or_default();
        let mut position = numbers(rest, what)?;
        let mut more = rest.split_ascii_whitespace().skip(3);
        match (more.next(), more.next(), more.next(), more.nth(1)) {
            (Some(w), None, ..) => {
                let [w]: [f32; 1] = numbers(w, what)?;
                if w == 0.0 {
                    return Err(mend("the fourth number of a vertex (w) is 0"));
                }
                position = position.map(|v: f32| v / w);
            }
            (Some(r), Some(g), Some(b), None) => {
                let color = color_of([r, g, b]);
                self.has_others |= color.is_none();
                self.colors.resize(self.positions.len(), NO_COLOR);
                self.colors.push(color.unwrap_or(NO_COLOR));
            }
            _ => {}
        }
        self.positions.push(position);
        if !self.colors.is_empty() {
            self.colors.resize(self.positions.len(), NO_COLOR);
        }
        Ok(())
    }

    fn face(&mut self, rest: &str) -> Checked<Statement> {
        let before = self.corners.len();
        for word in rest.split_ascii_whitespace().take_while(|word| !word.starts_with('#')) {
            self.corners.push(indices(word)?);
        }
        let defined = [self.positions.len(), self.uvs.len(), self.normals.len()].map(|count| count as u32);
        match self.corners.len() - before {
            0 => Err("the face names no vertices: delete the line".into()),
            count => Ok(Statement::Face(count as u32, defined)),
        }
    }
}

/// In place of the colour of a position that has none.
pub const NO_COLOR: [f32; 3] = [-1.0; 3];

/// Linear; `None` for what is no colour.
fn color_of(words: [&str; 3]) -> Option<[f32; 3]> {
    let [r, g, b] = words.map(|word| word.parse().ok().filter(|v| (0.0..=1.0).contains(v)).map(linear_from_srgb));
    Some([r?, g?, b?])
}

/// The indices of `v/vt/vn`.
fn indices(word: &str) -> Checked<Indices> {
    let mut indices = [NO_INDEX; 3];
    for (i, part) in word.split('/').enumerate() {
        let index = indices.get_mut(i).ok_or_else(|| format!("\"{word}\" has more than two slashes"))?;
        if !part.is_empty() || i == 0 {
            let number = part.parse().ok().filter(|&number| number != NO_INDEX);
            *index = number.ok_or_else(|| format!("\"{word}\" is no vertex of a face"))?;
        }
    }
    Ok(indices)
}

fn mend(what: &str) -> String {
    format!("{what}: mend the line or export the file again")
}

/// The first numbers of a statement.
fn numbers<const N: usize>(rest: &str, what: &str) -> Checked<[f32; N]> {
    let (mut words, mut found) = (rest.split_ascii_whitespace(), [0.0; N]);
    for number in &mut found {
        *number = words.next().and_then(|word| word.parse().ok()).ok_or_else(|| mend(what))?;
    }
    Ok(found)
}
