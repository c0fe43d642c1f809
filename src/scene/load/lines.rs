//! The lines of a text file, however the system that wrote it ends them: by line feeds, carriage returns or both. Lines that
//! end in a backslash are joined with the next one, and bytes that are not UTF-8 are replaced.
use std::borrow::Cow;
use std::io::{BufRead, Read};

/// Reads line by line, and knows their numbers.
pub struct Lines<R> {
    inner: R,
    raw: Vec<u8>,
    /// What was read up to a line feed, and how much of it was taken: old files end their lines by carriage returns alone.
    chunk: Vec<u8>,
    taken: usize,
    /// Number of the last line that was read, from 1.
    number: usize,
}

/// A line with its continuations.
pub struct Line<'a> {
    /// Number of the last of its lines in the file, from 1.
    pub number: usize,
    /// Text without the line's end.
    pub text: Cow<'a, str>,
}

/// The reason why a line cannot be read, and its number.
pub type Unreadable = (usize, &'static str);

/// Most bytes of a line with its continuations.
const LONGEST: usize = 1 << 26;
const TOO_LONG: &str = "64 MiB without a line feed: is this an OBJ file?";
const CUT: &str = "the file could not be read to its end: mend the line or export the file again";
const WIDE: &str = "the file is UTF-16 text: save it as UTF-8";

impl<R: BufRead> Lines<R> {
    /// Starts before the first line.
    pub fn new(inner: R) -> Self {
        Self { inner, raw: Vec::new(), chunk: Vec::new(), taken: 0, number: 0 }
    }

    /// The next line, with its continuations; `None` at the end.
    ///
    /// # Errors
    /// For a line of more than 64 MiB, UTF-16, and what the system says while it reads.
    pub fn next(&mut self) -> Result<Option<Line<'_>>, Unreadable> {
        self.raw.clear();
        while self.append().map_err(|what| (self.number.max(1), what))? {
            match self.raw.last_mut() {
                Some(last) if *last == b'\\' => *last = b' ',
                _ => return Ok(Some(self.line())),
            }
        }
        Ok((!self.raw.is_empty()).then(|| self.line()))
    }

    fn line(&self) -> Line<'_> {
        Line { number: self.number, text: String::from_utf8_lossy(&self.raw) }
    }

    /// Appends the next line to `raw`, without its end; false at the end of the file.
    fn append(&mut self) -> Result<bool, &'static str> {
        if self.taken == self.chunk.len() && !self.next_chunk()? {
            return Ok(false);
        }
        self.number += 1;
        let rest = &self.chunk[self.taken..];
        // `contains` is fast where there is none, as nearly always.
        let end = if rest.contains(&b'\r') { rest.iter().position(|&b| b == b'\r') } else { None };
        let end = end.unwrap_or(rest.len());
        self.raw.extend_from_slice(&rest[..end]);
        self.taken = (self.taken + end + 1).min(self.chunk.len());
        if self.raw.len() > LONGEST { Err(TOO_LONG) } else { Ok(true) }
    }

    /// Reads up to the next line feed, which is dropped together with a carriage return before it.
    fn next_chunk(&mut self) -> Result<bool, &'static str> {
        self.chunk.clear();
        self.taken = 0;
        let most = LONGEST as u64 + 2;
        if self.inner.by_ref().take(most).read_until(b'\n', &mut self.chunk).map_err(|_| CUT)? == 0 {
            return Ok(false);
        }
        if self.chunk.len() > LONGEST && !self.chunk.ends_with(b"\n") {
            return Err(TOO_LONG);
        }
        if self.number == 0 && (self.chunk.starts_with(&[0xff, 0xfe]) || self.chunk.starts_with(&[0xfe, 0xff])) {
            return Err(WIDE);
        }
        if self.number == 0 && self.chunk.starts_with("\u{feff}".as_bytes()) {
            self.chunk.drain(..3);
        }
        for end in [b'\n', b'\r'] {
            self.chunk.pop_if(|last| *last == end);
        }
        Ok(true)
    }
}
