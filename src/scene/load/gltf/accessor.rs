//! Reads accessors: numbers of a buffer that lie a stride apart, some of which a sparse list may replace.
use super::asset::Asset;
use crate::error::Result;
use crate::memory;
use gltf_json::Accessor;
use gltf_json::accessor::{ComponentType, Type, sparse};
use gltf_json::validation::Checked;

/// Most elements of an accessor without a buffer view, all of which are zero: nothing in the file bounds their number.
const MOST_ZEROS: u64 = 1 << 24;

/// An accessor whose elements all lie within its buffer.
pub struct Elements<'a> {
    count: usize,
    /// Numbers of an element.
    width: usize,
    kind: ComponentType,
    normalized: bool,
    stride: usize,
    /// From the first element on; `None` where all are zero.
    bytes: Option<&'a [u8]>,
    /// Places of the elements that are replaced, increasing, and what replaces them, tightly packed.
    sparse: Option<(Vec<u32>, &'a [u8])>,
}

impl<'a> Elements<'a> {
    /// Checks accessor `index`: count, types, that it ends within its view, and its sparse indices.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] with what does not fit.
    pub fn of(asset: &'a Asset, index: usize) -> Result<Self> {
        let place = format!("accessor {index}");
        let all = asset.root.accessors.len();
        let found = asset.root.accessors.get(index);
        let accessor = found.ok_or_else(|| asset.at(&place, format!("is not there: there are {all}")))?;
        let elements = Self::plain(asset, accessor)?.map_err(|what| asset.at(&place, what))?;
        match &accessor.sparse {
            Some(sparse) => elements.with_sparse(asset, sparse)?.map_err(|what| asset.at(place, what)),
            None => Ok(elements),
        }
    }

    fn plain(asset: &'a Asset, accessor: &Accessor) -> Result<std::result::Result<Self, String>> {
        let view = accessor.buffer_view.map(|view| Ok((asset.view(view.value())?, view.value()))).transpose()?;
        let stride = view.and_then(|(_, view)| asset.root.buffer_views[view].byte_stride);
        Ok(Self::within(accessor, view.map(|(bytes, _)| bytes), stride.map(|s| s.0)))
    }

    fn within(accessor: &Accessor, view: Option<&'a [u8]>, stride: Option<usize>) -> std::result::Result<Self, String> {
        let (Checked::Valid(shape), Checked::Valid(kind)) = (accessor.type_, accessor.component_type) else {
            return Err("has a type that glTF does not know".into());
        };
        let kind = kind.0;
        // glTF 2.0, section 3.6.2.4: columns begin at multiples of four bytes. Nothing in a scene has such matrices.
        let width = match (shape, kind.size()) {
            (Type::Mat2, 1) => 8,
            (Type::Mat3, 1 | 2) => 12,
            _ => shape.multiplicity(),
        };
        let (size, count) = (width * kind.size(), accessor.count.0);
        let stride = stride.unwrap_or(size);
        if count == 0 {
            return Err("has no elements: its count must be 1 or more".into());
        }
        if stride < size {
            return Err(format!("has elements of {size} bytes in steps of {stride}"));
        }
        let first = u128::from(accessor.byte_offset.unwrap_or_default().0);
        let end = first + stride as u128 * u128::from(count - 1) + size as u128;
        let bytes = match view {
            Some(view) if end > view.len() as u128 => {
                return Err(format!("ends at byte {end} of its buffer view, which has {}", view.len()));
            }
            Some(view) => Some(&view[first as usize..]),
            None if count > MOST_ZEROS => {
                return Err(format!("has {count} elements and no buffer view: {MOST_ZEROS} are the most"));
            }
            None => None,
        };
        let normalized = accessor.normalized;
        Ok(Self { count: count as usize, width, kind, normalized, stride, bytes, sparse: None })
    }

    fn with_sparse(self, asset: &'a Asset, sparse: &sparse::Sparse) -> Result<std::result::Result<Self, String>> {
        let indices = asset.view(sparse.indices.buffer_view.value())?;
        let values = asset.view(sparse.values.buffer_view.value())?;
        Ok(self.replaced(sparse, indices, values))
    }

    fn replaced(self, sparse: &sparse::Sparse, indices: &[u8], values: &'a [u8]) -> std::result::Result<Self, String> {
        let Checked::Valid(kind) = sparse.indices.component_type else {
            return Err("has sparse indices of a type that glTF does not know".into());
        };
        let count = sparse.count.0;
        if count == 0 || count > self.count as u64 {
            return Err(format!("replaces {count} of its {} elements", self.count));
        }
        let indices = part(indices, sparse.indices.byte_offset.0, count, kind.0.size(), "sparse indices")?;
        let values = part(values, sparse.values.byte_offset.0, count, self.size(), "sparse values")?;
        let places: Vec<u32> = indices.chunks_exact(kind.0.size()).map(|bytes| integer(bytes, kind.0)).collect();
        let rises = places.windows(2).all(|pair| pair[0] < pair[1]);
        match places.last().filter(|&&last| !rises || last as usize >= self.count) {
            Some(_) => Err(format!("has sparse indices that do not rise, or reach {} elements", self.count)),
            None => Ok(Self { sparse: Some((places, values)), ..self }),
        }
    }

    /// Number of elements, at least 1.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Numbers of an element, 1 to 16.
    pub fn width(&self) -> usize {
        self.width
    }

    /// All elements as N numbers each: integers are whole numbers or, if the accessor is normalized, in [0, 1] or [-1, 1].
    ///
    /// # Errors
    /// A sentence, when elements do not have N numbers or memory is short.
    pub fn numbers<const N: usize>(&self) -> std::result::Result<Vec<[f32; N]>, String> {
        self.numbers_of(0..self.count)
    }

    /// As [`Self::numbers`], of these elements alone, whose numbers are below the count.
    ///
    /// # Errors
    /// Likewise.
    pub fn numbers_of<const N: usize>(
        &self,
        chosen: impl ExactSizeIterator<Item = usize>,
    ) -> std::result::Result<Vec<[f32; N]>, String> {
        if self.width != N {
            return Err(format!("has elements of {} numbers where {N} are needed", self.width));
        }
        let one = |bytes: &[u8]| {
            let mut parts = bytes.chunks_exact(self.kind.size());
            std::array::from_fn(|_| parts.next().map_or(0.0, |part| number(part, self.kind, self.normalized)))
        };
        self.read(chosen, [0.0; N], one)
    }

    /// All elements as indices.
    ///
    /// # Errors
    /// A sentence, when they are no unsigned integers or memory is short.
    pub fn indices(&self) -> std::result::Result<Vec<u32>, String> {
        match self.kind {
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32 if self.width == 1 => {
                self.read(0..self.count, 0, |bytes| integer(bytes, self.kind))
            }
            _ => Err("has no unsigned integers, as indices are".into()),
        }
    }

    fn read<T: Copy>(
        &self,
        chosen: impl ExactSizeIterator<Item = usize>,
        zero: T,
        one: impl Fn(&[u8]) -> T,
    ) -> std::result::Result<Vec<T>, String> {
        let size = self.size();
        let element = |i: usize| {
            let replaced = self.sparse.as_ref().and_then(|(places, values)| {
                let at = places.binary_search(&(i as u32)).ok()?;
                Some(one(&values[at * size..][..size]))
            });
            replaced.unwrap_or_else(|| self.bytes.map_or(zero, |bytes| one(&bytes[i * self.stride..][..size])))
        };
        let mut list = memory::reserved(chosen.len())?;
        list.extend(chosen.map(element));
        Ok(list)
    }

    fn size(&self) -> usize {
        self.width * self.kind.size()
    }
}

/// `count` elements of `size` bytes from `first` on.
fn part<'a>(view: &'a [u8], first: u64, count: u64, size: usize, what: &str) -> std::result::Result<&'a [u8], String> {
    let end = u128::from(first) + u128::from(count) * size as u128;
    match end <= view.len() as u128 {
        true => Ok(&view[first as usize..end as usize]),
        false => Err(format!("has {what} that end at byte {end} of their buffer view, which has {}", view.len())),
    }
}

/// The number in little-endian `bytes`, whose length is that of `kind`. Normalized integers: glTF 2.0, section 3.6.2.2.
fn number(bytes: &[u8], kind: ComponentType, normalized: bool) -> f32 {
    let signed = |value: i16, most: f32| match normalized {
        true => (f32::from(value) / most).max(-1.0),
        false => f32::from(value),
    };
    let (small, large) = if normalized { (255.0, 65535.0) } else { (1.0, 1.0) };
    match (kind, bytes) {
        (ComponentType::I8, &[a]) => signed(i16::from(a as i8), 127.0),
        (ComponentType::U8, &[a]) => f32::from(a) / small,
        (ComponentType::I16, &[a, b]) => signed(i16::from_le_bytes([a, b]), 32767.0),
        (ComponentType::U16, &[a, b]) => f32::from(u16::from_le_bytes([a, b])) / large,
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => integer(bytes, kind) as f32,
    }
}

fn integer(bytes: &[u8], kind: ComponentType) -> u32 {
    match (kind, bytes) {
        (ComponentType::U8, &[a]) => u32::from(a),
        (ComponentType::U16, &[a, b]) => u32::from(u16::from_le_bytes([a, b])),
        (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]),
        _ => 0,
    }
}
