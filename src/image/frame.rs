//! The pixels of an EXR file that make up a film. The parts of a file can cover different rectangles (data windows), and
//! the display window is the rectangle that is shown.
use super::film::Window;
use crate::error::Checked;
use crate::memory;
use exr::meta::MetaData;
use exr::meta::attribute::IntegerBounds;
use exr::meta::header::Header;

/// Which pixels of a file make up its film.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Frame {
    /// The pixels that are shown: the display window.
    Display,
    /// The pixels that are stored: the smallest rectangle that holds the data windows of all parts.
    Data,
}

/// The frame of a file, from its headers alone.
pub(super) fn of(meta: &MetaData, frame: Frame) -> IntegerBounds {
    let display = meta.headers[0].shared_attributes.display_window;
    match frame {
        Frame::Display => display,
        Frame::Data => meta.headers.iter().map(window).reduce(union).unwrap_or(display),
    }
}

/// The data window of a part.
pub(super) fn window(header: &Header) -> IntegerBounds {
    IntegerBounds::new(header.own_attributes.layer_position, header.layer_size)
}

/// The smallest rectangle that holds both.
pub(super) fn union(a: IntegerBounds, b: IntegerBounds) -> IntegerBounds {
    let edges = |a: i32, a_size: usize, b: i32, b_size: usize| {
        let end = (i64::from(a) + a_size as i64).max(i64::from(b) + b_size as i64);
        (a.min(b), (end - i64::from(a.min(b))) as usize)
    };
    let (x, width) = edges(a.position.0, a.size.0, b.position.0, b.size.0);
    let (y, height) = edges(a.position.1, a.size.1, b.position.1, b.size.1);
    IntegerBounds::new((x, y), (width, height))
}

/// The part of `frame` that is stored; `None` if all of it is.
pub(super) fn held(data: IntegerBounds, frame: IntegerBounds) -> Option<Window> {
    let edges = |at: i32, size: usize, start: i32, length: usize| {
        let first = (i64::from(at) - i64::from(start)).clamp(0, length as i64);
        let end = (i64::from(at) - i64::from(start) + size as i64).clamp(first, length as i64);
        (first as u32, (end - first) as u32)
    };
    let (x, width) = edges(data.position.0, data.size.0, frame.position.0, frame.size.0);
    let (y, height) = edges(data.position.1, data.size.1, frame.position.1, frame.size.1);
    let all = (width as usize, height as usize) == (frame.size.0, frame.size.1);
    (!all).then_some(Window { first: [x, y], size: [width, height] })
}

/// The rectangle of a part of `frame`, as [`held`] tells it.
pub(super) fn part(window: Window, frame: IntegerBounds) -> IntegerBounds {
    let [x, y] = window.first.map(|first| first as i32);
    let size = window.size.map(|edge| edge as usize);
    IntegerBounds::new((frame.position.0 + x, frame.position.1 + y), (size[0], size[1]))
}

/// Copies samples from the rectangle `data` into the rectangle `window`. Pixels outside `data` are 0, and samples outside
/// `window` are dropped.
pub(super) fn shown<T: Copy + Default>(stored: &[T], data: IntegerBounds, window: IntegerBounds) -> Checked<Vec<T>> {
    let (width, height) = (window.size.0, window.size.1);
    let mut out = memory::reserved(width * height)?;
    out.resize(width * height, T::default());
    // Offsets of two 32-bit positions need 33 bits.
    let dx = i64::from(data.position.0) - i64::from(window.position.0);
    let dy = i64::from(data.position.1) - i64::from(window.position.1);
    let first = (-dx).clamp(0, data.size.0 as i64) as usize;
    let last = (width as i64 - dx).clamp(first as i64, data.size.0 as i64) as usize;
    for (row, values) in stored.chunks_exact(data.size.0.max(1)).enumerate() {
        let y = row as i64 + dy;
        if first < last && (0..height as i64).contains(&y) {
            let start = y as usize * width + (first as i64 + dx) as usize;
            out[start..start + last - first].copy_from_slice(&values[first..last]);
        }
    }
    Ok(out)
}
