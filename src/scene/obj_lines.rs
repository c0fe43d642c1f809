//! The lines of an OBJ file on their way to tobj. Continued lines are joined, bytes that are not UTF-8 replaced, vertex
//! colours dropped, and every face index is checked against what is defined above it, so that errors have a line.
//! Where faces with and without normals (texture coordinates) alternate, a group statement is slipped in between:
//! tobj would otherwise lend a corner the normal of its neighbour.
use std::collections::BTreeSet;
use std::io::{BufRead, Read};

/// A `BufRead` over the mended lines.
pub struct ObjLines<R> {
    inner: R,
    /// The mended line, and how much of it was handed out.
    out: Vec<u8>,
    used: usize,
    raw: Vec<u8>,
    /// v, vt, vn so far.
    defined: [i64; 3],
    /// Has texture coordinates, has normals; of the last face.
    format: Option<[bool; 2]>,
    group: String,
    /// Names after `usemtl`.
    pub worn: BTreeSet<String>,
    /// Faces of one or two corners, dropped: how many, and the line of the first.
    pub short_faces: (usize, usize),
    /// Number of the last line read, from 1.
    pub line: usize,
    /// What is wrong with a face, and its line.
    pub error: Option<(usize, String)>,
}

const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

impl<R: BufRead> ObjLines<R> {
    /// The name of the material library that stands for the scene file's own materials; served before the first line.
    pub const TABLES: &'static str = "\u{1}tables";

    /// Starts before the first line.
    pub fn new(inner: R) -> Self {
        let out = format!("mtllib {}\n", Self::TABLES).into_bytes();
        let group = "unnamed_object".to_owned();
        let (raw, defined, format, worn) = (Vec::new(), [0; 3], None, BTreeSet::new());
        Self { inner, out, used: 0, raw, defined, format, group, worn, short_faces: (0, 0), line: 0, error: None }
    }

    /// Reads the next line, with its continuations, into `raw`; false at the end.
    fn next_raw(&mut self) -> std::io::Result<bool> {
        self.raw.clear();
        loop {
            let got = self.inner.read_until(b'\n', &mut self.raw)?;
            if got == 0 {
                return Ok(!self.raw.is_empty());
            }
            self.line += 1;
            if self.line == 1 && self.raw.starts_with("\u{feff}".as_bytes()) {
                self.raw.drain(..3);
            }
            while matches!(self.raw.last(), Some(b'\n' | b'\r')) {
                self.raw.pop();
            }
            match self.raw.last() {
                Some(b'\\') => *self.raw.last_mut().expect("just seen") = b' ',
                _ => return Ok(true),
            }
        }
    }

    fn refill(&mut self) -> std::io::Result<()> {
        self.out.clear();
        self.used = 0;
        if !self.next_raw()? {
            return Ok(());
        }
        let raw = std::mem::take(&mut self.raw);
        let text = String::from_utf8_lossy(&raw);
        let outcome = self.mend(text.trim_start());
        drop(text);
        self.raw = raw;
        if let Err(what) = outcome {
            self.error = Some((self.line, what));
            return Err(std::io::ErrorKind::InvalidData.into());
        }
        self.out.push(b'\n');
        Ok(())
    }

    fn mend(&mut self, text: &str) -> Result<(), String> {
        let (key, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let mut text = text;
        match key {
            "v" => {
                self.defined[0] += 1;
                text = without_color(text);
            }
            "vt" => self.defined[1] += 1,
            "vn" => self.defined[2] += 1,
            "f" => return self.face(rest),
            "o" | "g" => {
                self.group = rest.trim().to_owned();
                self.format = None;
            }
            "usemtl" if !self.worn.contains(rest.trim()) => {
                self.worn.insert(rest.trim().to_owned());
            }
            // Lines carry nothing that a path tracer shows, and tobj would check their indices late.
            "l" | "p" => return Ok(()),
            _ => {}
        }
        self.out.extend_from_slice(text.as_bytes());
        Ok(())
    }

    fn face(&mut self, rest: &str) -> Result<(), String> {
        let mut format = [true; 2];
        let mut corners = 0;
        for word in rest.split_ascii_whitespace() {
            let has = self.corner(word)?;
            (0..2).for_each(|i| format[i] &= has[i]);
            corners += 1;
        }
        match corners {
            0 => return Err("the face names no vertices: delete the line".into()),
            1 | 2 => {
                let (count, first) = self.short_faces;
                self.short_faces = (count + 1, if count == 0 { self.line } else { first });
                return Ok(());
            }
            _ => {}
        }
        if self.format.is_some_and(|f| f != format) {
            self.out.extend_from_slice(format!("g {}\n", self.group).as_bytes());
        }
        self.format = Some(format);
        self.out.push(b'f');
        for word in rest.split_ascii_whitespace() {
            self.out.push(b' ');
            write_corner(word, format, &mut self.out);
        }
        Ok(())
    }

    /// Checks `v/vt/vn` and tells whether vt and vn are there.
    fn corner(&self, word: &str) -> Result<[bool; 2], String> {
        let mut has = [false; 3];
        for (i, part) in word.split('/').enumerate() {
            if part.is_empty() && i > 0 {
                continue;
            }
            let count = *self.defined.get(i).ok_or_else(|| format!("\"{word}\" has more than two slashes"))?;
            let index: i64 = part.parse().map_err(|_| format!("\"{word}\" is no vertex of a face"))?;
            if index == 0 || index > count || index < -count {
                let kind = KINDS[i];
                return Err(format!(
                    "the face uses {kind} {index}, but {count} are defined above it: export the file again"
                ));
            }
            has[i] = true;
        }
        Ok([has[1], has[2]])
    }
}

/// Keeps `v x y z` and `v x y z w`, drops colours (three numbers more).
fn without_color(text: &str) -> &str {
    let end = |words: usize| {
        let mut starts = text.split_ascii_whitespace().map(|w| w.as_ptr() as usize - text.as_ptr() as usize + w.len());
        starts.nth(words)
    };
    match end(5) {
        Some(_) => &text[..end(3).unwrap_or(text.len())],
        None => text,
    }
}

/// The corner without the parts that not all corners of its face have.
fn write_corner(word: &str, [uv, normal]: [bool; 2], out: &mut Vec<u8>) {
    let mut parts = word.split('/');
    let mut part = || parts.next().unwrap_or("");
    let [v, vt, vn] = [part(), part(), part()];
    out.extend_from_slice(v.as_bytes());
    if uv || normal {
        out.push(b'/');
        out.extend_from_slice(if uv { vt.as_bytes() } else { b"" });
    }
    if normal {
        out.push(b'/');
        out.extend_from_slice(vn.as_bytes());
    }
}

impl<R: BufRead> Read for ObjLines<R> {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        let n = self.fill_buf()?.read(buf)?;
        self.consume(n);
        Ok(n)
    }
}

impl<R: BufRead> BufRead for ObjLines<R> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        // A dropped line leaves only its newline; the end of the file leaves nothing.
        if self.used == self.out.len() {
            self.refill()?;
        }
        Ok(&self.out[self.used..])
    }

    fn consume(&mut self, amount: usize) {
        self.used += amount;
    }
}
