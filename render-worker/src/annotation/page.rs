//! The page that everything is drawn on: what is where, in which order it lies, and how large a letter is.

use super::text::{self, Text};

/// Letters of a text of usual size for each pixel of the picture's size (the root of its area): 16 pixels at 1600 x 900.
const EM_PER_PX: f64 = 1.0 / 75.0;
/// Smallest and largest usual text, pixels: what can be read, and what a picture of 4096 pixels has.
const EM_LIMITS_PX: [f64; 2] = [11.0, 60.0];
/// Distance of panels from the edges, letters.
const MARGIN_EM: f64 = 1.1;
/// Share of the picture on either side of its middle that panels leave free, across and down.
const MIDDLE: f64 = 0.15;

/// A rectangle, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Area {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) right: f64,
    pub(super) bottom: f64,
}

impl Area {
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn is_within(&self, other: &Self) -> bool {
        self.left >= other.left
            && self.right <= other.right
            && self.top >= other.top
            && self.bottom <= other.bottom
    }

    pub(super) fn grown(&self, by: f64) -> Self {
        Self {
            left: self.left - by,
            top: self.top - by,
            right: self.right + by,
            bottom: self.bottom + by,
        }
    }
}

/// A corner of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Corner {
    TopLeft,
    TopRight,
    BottomLeft,
    BottomRight,
}

/// What is drawn so far.
pub(super) struct Page {
    size: [f64; 2],
    em: f64,
    taken: Vec<Area>,
    /// Height of what lies along the lower edge.
    foot: f64,
    labels: String,
    panels: String,
}

impl Page {
    pub(super) fn new(size_px: [u32; 2]) -> Self {
        let size = size_px.map(f64::from);
        let [least, most] = EM_LIMITS_PX;
        Self {
            size,
            em: ((size[0] * size[1]).sqrt() * EM_PER_PX).clamp(least, most),
            taken: vec![],
            foot: 0.0,
            labels: String::new(),
            panels: String::new(),
        }
    }

    /// Width and height, pixels.
    pub(super) fn size(&self) -> [f64; 2] {
        self.size
    }

    /// Height of a letter of usual size, pixels.
    pub(super) fn em(&self) -> f64 {
        self.em
    }

    /// Width and height without what lies along the lower edge, pixels.
    pub(super) fn free_size(&self) -> [f64; 2] {
        [self.size[0], self.size[1] - self.foot]
    }

    pub(super) fn margin(&self) -> f64 {
        MARGIN_EM * self.em
    }

    /// All of the picture but a narrow edge and what lies along its lower one.
    pub(super) fn inside(&self) -> Area {
        let edge = 0.4 * self.em;
        Area {
            left: edge,
            top: edge,
            right: self.size[0] - edge,
            bottom: self.size[1] - edge.max(self.foot),
        }
    }

    /// Keeps so many pixels more along the lower edge free, and tells where that begins.
    pub(super) fn take_foot(&mut self, height: f64) -> f64 {
        self.foot += height;
        self.size[1] - self.foot
    }

    /// Keeps an area if it lies inside the picture and nothing is there yet.
    pub(super) fn take(&mut self, area: Area) -> bool {
        let is_free = area.is_within(&self.inside()) && !self.is_taken(&area);
        if is_free {
            self.taken.push(area);
        }
        is_free
    }

    fn is_taken(&self, area: &Area) -> bool {
        self.taken.iter().any(|taken| taken.overlaps(area))
    }

    /// Room for a panel of a width and height in the first of the corners that has it; none where it would cover the
    /// middle of the picture, or another panel.
    pub(super) fn take_corner(
        &mut self,
        [width, height]: [f64; 2],
        corners: &[Corner],
    ) -> Option<Area> {
        let [across, down] = self.size;
        let middle = Area {
            left: across * (0.5 - MIDDLE),
            top: down * (0.5 - MIDDLE),
            right: across * (0.5 + MIDDLE),
            bottom: down * (0.5 + MIDDLE),
        };
        let foot = self.foot;
        let margin = self.margin();
        let areas = corners.iter().map(|corner| {
            let left = match corner {
                Corner::TopLeft | Corner::BottomLeft => margin,
                Corner::TopRight | Corner::BottomRight => across - margin - width,
            };
            let top = match corner {
                Corner::TopLeft | Corner::TopRight => margin,
                Corner::BottomLeft | Corner::BottomRight => down - foot.max(margin) - height,
            };
            Area {
                left,
                top,
                right: left + width,
                bottom: top + height,
            }
        });
        let gap = 0.5 * self.em;
        let mut free = areas.filter(|area| {
            area.is_within(&self.inside())
                && !area.overlaps(&middle)
                && !self.is_taken(&area.grown(gap))
        });
        let area = free.next()?;
        self.taken.push(area.grown(gap));
        Some(area)
    }

    /// Writes over the picture.
    pub(super) fn label(&mut self, text: &Text<'_>) {
        self.labels.push_str(&text.svg());
    }

    /// Draws above all else.
    pub(super) fn panel(&mut self, svg: &str) {
        self.panels.push_str(svg);
    }

    pub(super) fn into_svg(self) -> String {
        let opening = text::opening(self.size);
        [&opening, &self.labels, &self.panels, "</svg>"].concat()
    }
}
