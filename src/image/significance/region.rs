//! The regions of an image at one scale. Regions of a scale share no pixel.
use super::{Estimate, MIN_PIXELS};
use crate::error::Checked;
use crate::layout::NONE;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt::{self, Display};
use std::str::FromStr;

/// How large regions are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Single pixels.
    Pixel,
    /// Blocks of about so many pixels along each edge, none of them smaller.
    Block(u32),
    /// What each object covers.
    Object,
    /// The whole image.
    Image,
}

impl Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Pixel => f.write_str("pixel"),
            Self::Block(edge) => write!(f, "{edge}x{edge}"),
            Self::Object => f.write_str("object"),
            Self::Image => f.write_str("image"),
        }
    }
}

impl FromStr for Scale {
    type Err = String;

    fn from_str(text: &str) -> Checked<Self> {
        let block = |edge: u32| Self::Block(edge);
        match text {
            "pixel" => Ok(Self::Pixel),
            "object" => Ok(Self::Object),
            "image" => Ok(Self::Image),
            _ => BLOCKS.into_iter().map(block).find(|scale| scale.to_string() == text).ok_or_else(|| {
                let blocks = BLOCKS.map(|edge| block(edge).to_string()).join(", ");
                format!("expected pixel, {blocks}, object or image")
            }),
        }
    }
}

impl Serialize for Scale {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Edges of blocks.
const BLOCKS: [u32; 5] = [4, 16, 64, 256, 1024];

/// Where a region is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Where {
    /// The scale that it belongs to.
    pub scale: Scale,
    /// Its first column and row.
    pub first: [u32; 2],
    /// Its last column and row; an object need not fill the rectangle.
    pub last: [u32; 2],
    /// The object's index, in the layer `id`.
    pub object: Option<u32>,
}

impl Display for Where {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let ([x, y], [right, bottom]) = (self.first, self.last);
        match (self.scale, self.object) {
            (Scale::Pixel, _) => write!(f, "pixel ({x}, {y})"),
            (Scale::Image, _) => f.write_str("the whole image"),
            (_, Some(NONE)) => write!(f, "what no object covers in ({x}, {y}) to ({right}, {bottom})"),
            (_, Some(object)) => write!(f, "object {object} in ({x}, {y}) to ({right}, {bottom})"),
            (_, None) => write!(f, "block ({x}, {y}) to ({right}, {bottom})"),
        }
    }
}

/// The regions of one scale.
pub struct Partition {
    pub scale: Scale,
    pub regions: usize,
    size: [u32; 2],
    /// Regions along each axis, of all but objects.
    grid: [u32; 2],
    /// For each pixel the place of its object in `ids`.
    objects: Vec<u32>,
    ids: Vec<u32>,
}

impl Partition {
    /// All scales at which these images can be judged, the finest first.
    pub fn all(a: &Estimate, b: &Estimate) -> Vec<Self> {
        let size = [a.width, a.height];
        let grid = |scale, grid| Self::grid(scale, size, grid);
        let blocks = BLOCKS.into_iter().map(|edge| (edge, size.map(|s| (s / edge).max(1))));
        let enough = |(edge, [x, y]): &(u32, [u32; 2])| x * y > 1 && size.iter().all(|s| s >= edge);
        let mut all = vec![Self::pixels(a)];
        all.extend(blocks.filter(enough).map(|(edge, along)| grid(Scale::Block(edge), along)));
        all.extend(Self::objects(a, b));
        all.push(grid(Scale::Image, [1, 1]));
        all
    }

    /// Every pixel by itself.
    pub fn pixels(image: &Estimate) -> Self {
        let size = [image.width, image.height];
        Self::grid(Scale::Pixel, size, size)
    }

    fn grid(scale: Scale, size: [u32; 2], grid: [u32; 2]) -> Self {
        let regions = grid[0] as usize * grid[1] as usize;
        Self { scale, regions, size, grid, objects: Vec::new(), ids: Vec::new() }
    }

    /// The objects, if both images show the same ones in the same pixels.
    fn objects(a: &Estimate, b: &Estimate) -> Option<Self> {
        let ids = a.objects.as_ref().filter(|_| a.objects == b.objects)?;
        let mut pixels = BTreeMap::<u32, usize>::new();
        ids.iter().for_each(|id| *pixels.entry(*id).or_default() += 1);
        let judged: Vec<u32> = pixels.into_iter().filter(|(_, n)| *n >= MIN_PIXELS).map(|(id, _)| id).collect();
        let place = |id: &u32| judged.binary_search(id).map_or(u32::MAX, |i| i as u32);
        let objects = ids.iter().map(place).collect();
        (judged.len() > 1).then_some(Self {
            scale: Scale::Object,
            regions: judged.len(),
            size: [a.width, a.height],
            grid: [0, 0],
            objects,
            ids: judged,
        })
    }

    /// The region that a pixel lies in; none for objects that are too small.
    pub fn region(&self, pixel: usize) -> Option<usize> {
        match self.scale {
            Scale::Pixel => Some(pixel),
            Scale::Image => Some(0),
            Scale::Object => Some(self.objects[pixel]).filter(|o| *o != u32::MAX).map(|o| o as usize),
            Scale::Block(_) => {
                let at = [pixel as u64 % u64::from(self.size[0]), pixel as u64 / u64::from(self.size[0])];
                let [x, y] = [0, 1].map(|i| at[i] * u64::from(self.grid[i]) / u64::from(self.size[i]));
                Some((y * u64::from(self.grid[0]) + x) as usize)
            }
        }
    }

    /// Where a region is.
    pub fn place(&self, region: usize) -> Where {
        if self.scale == Scale::Object {
            return self.place_of_object(region);
        }
        let at = [region as u64 % u64::from(self.grid[0]), region as u64 / u64::from(self.grid[0])];
        // The first pixel p with p grid / size = at, rounded down.
        let edge = |i: usize, at: u64| (at * u64::from(self.size[i])).div_ceil(self.grid[i].into()) as u32;
        let [first, end] = [0, 1].map(|next| [0, 1].map(|i| edge(i, at[i] + next)));
        Where { scale: self.scale, first, last: end.map(|e| e - 1), object: None }
    }

    fn place_of_object(&self, region: usize) -> Where {
        let pixels = (0..self.objects.len()).filter(|i| self.objects[*i] == region as u32);
        let at = |i: usize| [i as u32 % self.size[0], i as u32 / self.size[0]];
        let start = (self.size, [0, 0]);
        let grow = |(low, high): ([u32; 2], [u32; 2]), p: [u32; 2]| {
            ([0, 1].map(|i: usize| low[i].min(p[i])), [0, 1].map(|i: usize| high[i].max(p[i])))
        };
        let (first, last) = pixels.map(at).fold(start, grow);
        Where { scale: self.scale, first, last, object: Some(self.ids[region]) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::significance::Noise;

    fn image(width: u32, height: u32, objects: Option<Vec<u32>>) -> Estimate {
        let pixels = (width * height) as usize;
        let noise = Noise::SquaredErrors(vec![[0.0; 3]; pixels]);
        Estimate { width, height, mean: vec![[1.0; 3]; pixels], noise, objects }
    }

    #[test]
    fn the_sky_is_no_object() {
        let of = |object| Where { scale: Scale::Object, first: [1, 2], last: [3, 4], object: Some(object) }.to_string();
        assert_eq!([of(7), of(NONE)], ["object 7 in (1, 2) to (3, 4)", "what no object covers in (1, 2) to (3, 4)"]);
    }

    #[test]
    fn blocks_cover_the_image_and_are_where_they_say() {
        let image = image(37, 21, None);
        let all = Partition::all(&image, &image);
        let scales: Vec<String> = all.iter().map(|p| p.scale.to_string()).collect();
        assert_eq!(scales, ["pixel", "4x4", "16x16", "image"]);
        for partition in &all {
            let mut pixels = vec![0; partition.regions];
            for pixel in 0..37 * 21 {
                let region = partition.region(pixel).unwrap();
                let Where { first, last, .. } = partition.place(region);
                let at = [pixel as u32 % 37, pixel as u32 / 37];
                assert!((0..2).all(|i| (first[i]..=last[i]).contains(&at[i])), "{at:?} {}", partition.place(region));
                pixels[region] += 1;
            }
            let area = |r: usize| {
                let Where { first, last, .. } = partition.place(r);
                (last[0] - first[0] + 1) * (last[1] - first[1] + 1)
            };
            assert!((0..partition.regions).all(|r| pixels[r] == area(r)), "{}", partition.scale);
        }
        assert_eq!("16x16".parse(), Ok(Scale::Block(16)));
        assert!("17x17".parse::<Scale>().unwrap_err().contains("16x16"));
    }

    #[test]
    fn objects_are_regions_where_both_images_show_them() {
        let ids = |moved: u32| {
            Some(
                (0..256)
                    .map(|i| {
                        if i % 16 < 4 + moved {
                            7
                        } else if i == 255 {
                            9
                        } else {
                            3
                        }
                    })
                    .collect(),
            )
        };
        let (a, b) = (image(16, 16, ids(0)), image(16, 16, ids(1)));
        let object = |a: &Estimate, b: &Estimate| Partition::all(a, b).into_iter().find(|p| p.scale == Scale::Object);
        assert!(object(&a, &b).is_none(), "an object moved");
        let objects = object(&a, &a).unwrap();
        assert_eq!(
            (objects.regions, objects.region(0), objects.region(5), objects.region(255)),
            (2, Some(1), Some(0), None)
        );
        assert_eq!(objects.place(1), Where { scale: Scale::Object, first: [0, 0], last: [3, 15], object: Some(7) });
    }
}
