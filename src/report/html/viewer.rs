//! Viewers of images inside a page. Readers flip between images, zoom, pan, change the exposure, and see false colours, the
//! signed difference from a reference and the values of pixels; all viewers of a page with the same group move together. The
//! pixels are in the page as half floats, so that exposure and differences work on radiance. Without scripts, and on paper, each
//! image is shown as it is.
use super::pixels;
use crate::image::Picture;
use askama::Template;

/// Characters that the images of one viewer may take together. Browsers open pages of this size within seconds.
pub const BUDGET: usize = 60_000_000;
/// Pixels of the largest image that is shown whole: about eight fit into the budget.
const LARGEST: usize = 640_000;

/// One image of a [`Viewer`].
#[derive(Clone, Debug)]
pub struct Image<'a> {
    /// Name, which no other image of the viewer has.
    pub name: String,
    /// What is said about it below the image, such as its error; may be empty.
    pub caption: String,
    /// The image.
    pub picture: &'a Picture,
    /// Images of the greatest rank are the first that are left out of a page that would be too large.
    pub rank: usize,
}

/// A set of images that are compared with each other.
#[derive(Clone, Debug, Default)]
pub struct Viewer<'a> {
    /// Viewers of one page whose groups are equal share zoom, position, exposure and mode.
    pub group: String,
    /// The images in the order in which keys flip through them.
    pub images: Vec<Image<'a>>,
    /// Index of the image that differences refer to.
    pub reference: Option<usize>,
}

/// What `viewer.html` shows.
#[derive(Template)]
#[template(path = "viewer.html", config = "src/report/html/askama.toml")]
struct Content<'a> {
    group: &'a str,
    shots: Vec<Shot<'a>>,
    notes: Vec<String>,
}

/// One image in its text form.
struct Shot<'a> {
    image: &'a Image<'a>,
    key: Option<char>,
    is_reference: bool,
    crop: pixels::Crop,
    png: String,
    halves: String,
}

impl Viewer<'_> {
    /// The viewer as a part of a page, as a [`Section`](super::Section) and other pages include it. Large images are
    /// shown without their borders, and images that do not fit into [`BUDGET`] are left out; the viewer says so.
    pub fn html(&self) -> String {
        self.html_within(BUDGET)
    }

    fn html_within(&self, budget: usize) -> String {
        let (shots, missing) = self.shots(budget);
        let mut notes = Vec::new();
        if let Some(shot) = shots.iter().find(|shot| shot.crop.picture.pixels.len() < shot.image.picture.pixels.len()) {
            let (part, whole) = (&shot.crop.picture, shot.image.picture);
            notes.push(format!(
                "To keep this page small, large images show their middle only: {} x {} of {} x {} pixels.",
                part.width, part.height, whole.width, whole.height
            ));
        }
        if !missing.is_empty() {
            notes.push(format!("To keep this page small, these images are left out: {}.", missing.join("; ")));
        }
        Content { group: &self.group, shots, notes }.to_string()
    }

    /// Encodes images in the order of their ranks until the budget is used up. Returns them in the order of the viewer, and the
    /// names of the others.
    fn shots(&self, budget: usize) -> (Vec<Shot<'_>>, Vec<&str>) {
        let mut order: Vec<usize> = (0..self.images.len()).collect();
        order.sort_by_key(|&i| self.images[i].rank);
        let mut shots: Vec<(usize, Shot)> = Vec::new();
        let (mut missing, mut left) = (Vec::new(), budget);
        for index in order {
            match self.shot(index, left) {
                Some(shot) => {
                    left -= shot.png.len() + shot.halves.len();
                    shots.push((index, shot));
                }
                None => missing.push(index),
            }
        }
        shots.sort_by_key(|(index, _)| *index);
        missing.sort_unstable();
        let mut shots: Vec<Shot> = shots.into_iter().map(|(_, shot)| shot).collect();
        let others = shots.iter_mut().filter(|shot| !shot.is_reference);
        others.zip('1'..='9').for_each(|(shot, key)| shot.key = Some(key));
        (shots, missing.into_iter().map(|index| self.images[index].name.as_str()).collect())
    }

    /// `None` for an image without pixels, or of another number than its size says, or of more than `left` characters.
    /// What is too long is not encoded as far as its length is known before.
    fn shot(&self, index: usize, left: usize) -> Option<Shot<'_>> {
        let image = &self.images[index];
        let Picture { width, height, pixels } = image.picture;
        if pixels.len() != *width as usize * *height as usize {
            return None;
        }
        let crop = pixels::middle(image.picture, LARGEST);
        let left = left.checked_sub(pixels::length_of_halves(&crop.picture))?;
        let png = pixels::png(&crop.picture).ok().filter(|png| png.len() <= left)?;
        let halves = pixels::halves(&crop.picture);
        let is_reference = self.reference == Some(index);
        Some(Shot { image, key: is_reference.then_some('0'), is_reference, crop, png, halves })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_of_another_size_than_it_says_is_left_out() {
        let broken = Picture { width: 16, height: 16, pixels: vec![[0.5; 3]; 5] };
        let image = Image { name: "a".into(), caption: String::new(), picture: &broken, rank: 0 };
        let html = Viewer { group: "g".into(), images: vec![image], reference: None }.html();
        assert!(names(&html).is_empty() && html.contains("left out: a"), "{html}");
    }

    fn names(html: &str) -> Vec<&str> {
        html.split("data-name=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect()
    }

    #[test]
    fn images_of_the_greatest_rank_are_left_out_first_and_named() {
        let picture = Picture { width: 16, height: 16, pixels: vec![[0.5; 3]; 256] };
        let image = |name: &str, rank| Image { name: name.into(), caption: String::new(), picture: &picture, rank };
        let images = vec![image("a", 1), image("b", 2), image("truth", 0)];
        let viewer = Viewer { group: "g".into(), images, reference: Some(2) };
        assert_eq!(names(&viewer.html()), ["a", "b", "truth"]);
        assert!(!viewer.html().contains("left out"));
        let one = 256 * 8 + pixels::png(&picture).unwrap().len();
        let small = viewer.html_within(2 * one);
        assert_eq!(names(&small), ["a", "truth"]);
        assert!(small.contains("these images are left out: b."));
    }

    #[test]
    fn an_image_without_pixels_is_left_out() {
        let picture = Picture { width: 0, height: 0, pixels: Vec::new() };
        let image = Image { name: "void".into(), caption: String::new(), picture: &picture, rank: 0 };
        let viewer = Viewer { images: vec![image], ..Viewer::default() };
        assert!(viewer.html().contains("left out: void."));
    }
}
