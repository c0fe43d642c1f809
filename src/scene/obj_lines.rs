//! The lines of an OBJ file on their way to tobj. Continued lines are joined, bytes that are not UTF-8 replaced, vertex
//! colours dropped, and every face index is checked against what is defined above it, so that errors have a line.
//! Where faces with and without normals (texture coordinates) alternate, a group statement is slipped in between:
//! tobj would otherwise lend a corner the normal of its neighbour.
use crate::memory;
use std::collections::BTreeSet;
use std::io::{BufRead, Read};

/// A `BufRead` over the mended lines.
pub struct ObjLines<R> {
    inner: R,
    /// The mended line, and how much of it was handed out.
    out: Vec<u8>,
    used: usize,
    raw: Vec<u8>,
    /// What was read up to a line feed, and how much of it was taken: old files end their lines by carriage returns alone.
    chunk: Vec<u8>,
    taken: usize,
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
    /// Bytes that what was read so far takes, about, and how many of them memory was asked for.
    held: u64,
    asked: u64,
    /// What is said when there is no memory for more.
    pub lack: Option<String>,
}

/// Bytes of a line, with its continuations, at most.
const LONGEST_LINE: usize = 1 << 26;
const TOO_LONG: &str = "64 MiB without a line feed: is this an OBJ file?";
/// Estimated bytes that a parsed file takes before memory is asked for the first time.
const UNASKED: u64 = 1 << 26;

const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

impl<R: BufRead> ObjLines<R> {
    /// The name of the material library that stands for the scene file's own materials; served before the first line.
    pub const TABLES: &'static str = "\u{1}tables";

    /// Starts before the first line.
    pub fn new(inner: R) -> Self {
        let out = format!("mtllib {}\n", Self::TABLES).into_bytes();
        let group = "unnamed_object".to_owned();
        let (raw, chunk, defined, format, worn) = (Vec::new(), Vec::new(), [0; 3], None, BTreeSet::new());
        Self {
            inner,
            out,
            used: 0,
            raw,
            chunk,
            taken: 0,
            defined,
            format,
            group,
            worn,
            short_faces: (0, 0),
            line: 0,
            error: None,
            held: 0,
            asked: UNASKED,
            lack: None,
        }
    }

    /// Reads the next line, with its continuations, into `raw`; false at the end.
    fn next_raw(&mut self) -> std::io::Result<bool> {
        self.raw.clear();
        while self.next_line()? {
            match self.raw.last() {
                Some(b'\\') => *self.raw.last_mut().expect("just seen") = b' ',
                _ => return Ok(true),
            }
        }
        Ok(!self.raw.is_empty())
    }

    /// Appends the next line to `raw`, without its end; false at the end of the file.
    fn next_line(&mut self) -> std::io::Result<bool> {
        if self.taken == self.chunk.len() && !self.next_chunk()? {
            return Ok(false);
        }
        self.line += 1;
        let rest = &self.chunk[self.taken..];
        // `contains` is fast where there is none, as nearly always.
        let end = if rest.contains(&b'\r') { rest.iter().position(|&b| b == b'\r') } else { None };
        let end = end.unwrap_or(rest.len());
        self.raw.extend_from_slice(&rest[..end]);
        self.taken = (self.taken + end + 1).min(self.chunk.len());
        match self.raw.len() > LONGEST_LINE {
            true => self.refuse(TOO_LONG),
            false => Ok(true),
        }
    }

    /// Reads up to the next line feed, which is dropped together with a carriage return before it.
    fn next_chunk(&mut self) -> std::io::Result<bool> {
        self.chunk.clear();
        self.taken = 0;
        let most = LONGEST_LINE as u64 + 2;
        if self.inner.by_ref().take(most).read_until(b'\n', &mut self.chunk)? == 0 {
            return Ok(false);
        }
        if self.chunk.len() > LONGEST_LINE && !self.chunk.ends_with(b"\n") {
            return self.refuse(TOO_LONG);
        }
        if self.line == 0 && (self.chunk.starts_with(&[0xff, 0xfe]) || self.chunk.starts_with(&[0xfe, 0xff])) {
            return self.refuse("the file is UTF-16 text: save it as UTF-8");
        }
        if self.line == 0 && self.chunk.starts_with("\u{feff}".as_bytes()) {
            self.chunk.drain(..3);
        }
        for end in [b'\n', b'\r'] {
            self.chunk.pop_if(|last| *last == end);
        }
        Ok(true)
    }

    fn refuse(&mut self, what: &str) -> std::io::Result<bool> {
        self.error = Some((self.line.max(1), what.to_owned()));
        Err(std::io::ErrorKind::InvalidData.into())
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
            return self.refuse(&what).map(|_| ());
        }
        self.out.push(b'\n');
        self.ask()
    }

    /// Asks for as much memory again whenever what is held has doubled.
    fn ask(&mut self) -> std::io::Result<()> {
        if self.held > self.asked {
            self.asked = 2 * self.held;
            self.lack = memory::check(self.held).err();
        }
        match self.lack {
            Some(_) => Err(std::io::ErrorKind::OutOfMemory.into()),
            None => Ok(()),
        }
    }

    fn mend(&mut self, text: &str) -> Result<(), String> {
        let (key, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let mut text = text;
        self.held += match key {
            "v" => 90, // its numbers, those of a mesh's vertex, and a place in the table of vertices
            "vt" => 16,
            "vn" => 24,
            "o" | "g" | "usemtl" => 700, // a model
            _ => 0,
        };
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
        self.held += 104 + 20 * corners;
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
