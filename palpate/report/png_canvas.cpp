// SPDX-License-Identifier: Apache-2.0
// A rasteriser of our own: every shape becomes outlines, and outlines are filled with the share of each pixel that they
// cover (five lines of exact horizontal coverage a pixel).
#include <png.h>

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/report/canvas.hpp"
#include "palpate/report/stroke_font.hpp"

namespace palpate::report {
namespace {

constexpr int lines_a_pixel = 5;

class PngCanvas final : public Canvas {
 public:
  PngCanvas(double width, double height, double scale) : scale_(scale) {
    image_.width = static_cast<int>(std::lround(width * scale));
    image_.height = static_cast<int>(std::lround(height * scale));
    image_.rgba.assign(static_cast<std::size_t>(image_.width) * static_cast<std::size_t>(image_.height) * 4, 255);
  }

  void line(std::span<const Spot> spots, Colour colour, double width, bool dashed) override {
    std::vector<std::vector<Spot>> pieces;
    double run = 0;
    for (std::size_t i = 0; i + 1 < spots.size(); ++i) {
      if (!dashed) {
        add_piece(pieces, spots[i], spots[i + 1], width);
        continue;
      }
      constexpr double on = 4, period = 6.5;
      const double length = std::hypot(spots[i + 1].x - spots[i].x, spots[i + 1].y - spots[i].y);
      const auto at = [&](double s) {
        const double t = length > 0 ? s / length : 0;
        return Spot{spots[i].x + t * (spots[i + 1].x - spots[i].x), spots[i].y + t * (spots[i + 1].y - spots[i].y)};
      };
      for (double s = 0; s < length;) {
        const double phase = std::fmod(run + s, period);
        const double next = std::min(length, s + (phase < on ? on - phase : period - phase) + 1e-9);
        if (phase < on) add_piece(pieces, at(s), at(next), width);
        s = next;
      }
      run += length;
    }
    fill(pieces, colour, false);
  }

  void area(std::span<const std::vector<Spot>> outlines, Colour colour) override {
    fill({outlines.begin(), outlines.end()}, colour, true);
  }

  void text(Spot at, std::string_view words, double size, Align align, Colour colour, bool upright) override {
    const double unit = size / 30;  // the font's capitals are 21 units high, its lines 32
    double width = 0;
    for_each_glyph(words, [&](std::string_view glyph) { width += glyph[1] - glyph[0]; });
    double pen = align == Align::left ? 0 : align == Align::centre ? -width / 2 : -width;
    std::vector<std::vector<Spot>> pieces;
    for_each_glyph(words, [&](std::string_view glyph) {
      const double origin = pen - (glyph[0] - 'R');
      bool down = false;
      Spot last;
      for (std::size_t i = 2; i + 1 < glyph.size(); i += 2) {
        if (glyph[i] == ' ' && glyph[i + 1] == 'R') {
          down = false;
          continue;
        }
        const double x = (origin + glyph[i] - 'R') * unit,
                     y = (glyph[i + 1] - 'R' - 9) * unit;  // 9: from the middle to the baseline
        const Spot spot = upright ? Spot{at.x + x, at.y + y} : Spot{at.x + y, at.y - x};
        if (down) add_piece(pieces, last, spot, size / 13);
        last = spot;
        down = true;
      }
      pen += glyph[1] - glyph[0];
    });
    fill(pieces, colour, false);
  }

  void picture(Spot corner, double width, double height, const Picture& picture) override {
    const int x0 = std::max(0, static_cast<int>(corner.x * scale_)), y0 = std::max(0, static_cast<int>(corner.y * scale_));
    const int x1 = std::min(image_.width, static_cast<int>((corner.x + width) * scale_));
    const int y1 = std::min(image_.height, static_cast<int>((corner.y + height) * scale_));
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        const int u = std::min(picture.width - 1, (x - x0) * picture.width / std::max(1, x1 - x0));
        const int v = std::min(picture.height - 1, (y - y0) * picture.height / std::max(1, y1 - y0));
        const std::uint8_t* from = &picture.rgba[(static_cast<std::size_t>(v) * static_cast<std::size_t>(picture.width) +
                                                  static_cast<std::size_t>(u)) *
                                                 4];
        blend(x, y, {from[0], from[1], from[2], from[3] / 255.0}, 1);
      }
    }
  }

  std::string bytes() const override { return encode_png(image_); }

 private:
  template <class Use>
  static void for_each_glyph(std::string_view words, Use use) {
    for (const char c : words) {
      const auto code = static_cast<unsigned char>(c);
      if ((code & 0xC0u) == 0x80u) continue;  // the rest of a character beyond ASCII
      use(stroke_glyphs[code >= 32 && code < 127 ? code - 32u : static_cast<std::size_t>('?' - 32)]);
    }
  }

  /// One straight stroke with round ends.
  static void add_piece(std::vector<std::vector<Spot>>& pieces, Spot a, Spot b, double width) {
    const double angle = std::atan2(b.y - a.y, b.x - a.x), r = width / 2;
    std::vector<Spot> outline;
    constexpr int steps = 5;
    for (int end = 0; end < 2; ++end) {
      const Spot centre = end == 0 ? b : a;
      for (int i = 0; i <= steps; ++i) {
        const double t = angle + 3.14159265358979 * (end - 0.5 + static_cast<double>(i) / steps);
        outline.push_back({centre.x + r * std::cos(t), centre.y + r * std::sin(t)});
      }
    }
    pieces.push_back(std::move(outline));
  }

  void blend(int x, int y, Colour colour, double cover) {
    std::uint8_t* to =
        &image_
             .rgba[(static_cast<std::size_t>(y) * static_cast<std::size_t>(image_.width) + static_cast<std::size_t>(x)) * 4];
    const double a = std::clamp(cover, 0.0, 1.0) * colour.opacity;
    const std::array<std::uint8_t, 3> from = {colour.r, colour.g, colour.b};
    for (std::size_t k = 0; k < 3; ++k) to[k] = static_cast<std::uint8_t>(std::lround(to[k] * (1 - a) + from[k] * a));
  }

  /// Even-odd within one call, or the union of overlapping outlines (strokes).
  void fill(const std::vector<std::vector<Spot>>& outlines, Colour colour, bool even_odd) {
    double top = image_.height, bottom = 0;
    for (const auto& outline : outlines) {
      for (const Spot& spot : outline) {
        top = std::min(top, spot.y * scale_);
        bottom = std::max(bottom, spot.y * scale_);
      }
    }
    std::vector<double> cover(static_cast<std::size_t>(image_.width));
    std::vector<std::pair<double, int>> crossings;
    for (int y = std::max(0, static_cast<int>(top)); y < std::min(image_.height, static_cast<int>(bottom) + 1); ++y) {
      std::fill(cover.begin(), cover.end(), 0.0);
      for (int line = 0; line < lines_a_pixel; ++line) {
        const double at = y + (line + 0.5) / lines_a_pixel;
        crossings.clear();
        for (const auto& outline : outlines) {
          for (std::size_t i = 0; i < outline.size(); ++i) {
            const Spot& a = outline[i];
            const Spot& b = outline[(i + 1) % outline.size()];
            const double ya = a.y * scale_, yb = b.y * scale_;
            if ((ya <= at) == (yb <= at)) continue;
            crossings.emplace_back((a.x + (at - ya) / (yb - ya) * (b.x - a.x)) * scale_, ya < yb ? 1 : -1);
          }
        }
        std::sort(crossings.begin(), crossings.end());
        int inside = 0;
        for (std::size_t i = 0; i + 1 < crossings.size(); ++i) {
          inside += even_odd ? 1 : crossings[i].second;
          if (even_odd ? inside % 2 == 1 : inside != 0) add_span(cover, crossings[i].first, crossings[i + 1].first);
        }
      }
      for (int x = 0; x < image_.width; ++x) {
        if (cover[static_cast<std::size_t>(x)] > 0) blend(x, y, colour, cover[static_cast<std::size_t>(x)]);
      }
    }
  }

  static void add_span(std::vector<double>& cover, double from, double to) {
    const double end = static_cast<double>(cover.size());
    from = std::clamp(from, 0.0, end);
    to = std::clamp(to, 0.0, end);
    for (auto x = static_cast<std::size_t>(from); x < cover.size() && static_cast<double>(x) < to; ++x) {
      const double left = std::max(from, static_cast<double>(x)), right = std::min(to, static_cast<double>(x) + 1);
      if (right > left) cover[x] += (right - left) / lines_a_pixel;
    }
  }

  double scale_;
  Picture image_;
};

}  // namespace

std::string encode_png(const Picture& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width);
  image.height = static_cast<png_uint_32>(picture.height);
  image.format = PNG_FORMAT_RGBA;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, picture.rgba.data(), 0, nullptr) == 0) {
    throw Error(std::string("cannot make a PNG: ") + image.message, "report::encode_png");
  }
  bytes.resize(size);
  return bytes;
}

std::unique_ptr<Canvas> png_canvas(double width, double height, double scale) {
  return std::make_unique<PngCanvas>(width, height, scale);
}

}  // namespace palpate::report
