// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "palpate/report/canvas.hpp"
#include "palpate/report/thinning.hpp"

namespace palpate::report {
namespace {

std::string web(Colour c) { return fmt::format("#{:02x}{:02x}{:02x}", c.r, c.g, c.b); }

std::string escaped(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    if (c == '<') {
      safe += "&lt;";
    } else if (c == '>') {
      safe += "&gt;";
    } else if (c == '&') {
      safe += "&amp;";
    } else if (static_cast<unsigned char>(c) >= 32) {
      safe += c;
    }
  }
  return safe;
}

std::string path_of(std::span<const Spot> spots) {
  std::string path;
  for (std::size_t i = 0; i < spots.size(); ++i)
    path += fmt::format("{}{:.2f} {:.2f}", i == 0 ? "M" : "L", spots[i].x, spots[i].y);
  return path;
}

class SvgCanvas final : public Canvas {
 public:
  SvgCanvas(double width, double height)
      : head_(fmt::format(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}pt\" height=\"{1}pt\" viewBox=\"0 0 {0} {1}\" "
            "font-family=\"Helvetica, Arial, sans-serif\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n",
            width, height)) {}

  void line(std::span<const Spot> spots, Colour colour, double width, bool dashed) override {
    body_ += fmt::format(
        "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-opacity=\"{:.3g}\" stroke-width=\"{}\" "
        "stroke-linejoin=\"round\"{}/>\n",
        path_of(spots), web(colour), colour.opacity, width, dashed ? " stroke-dasharray=\"4 2.5\"" : "");
  }

  void area(std::span<const std::vector<Spot>> outlines, Colour colour) override {
    std::string path;
    for (const auto& outline : outlines) path += path_of(outline) + "Z";
    body_ += fmt::format("<path d=\"{}\" fill=\"{}\" fill-opacity=\"{:.3g}\" fill-rule=\"evenodd\"/>\n", path, web(colour),
                         colour.opacity);
  }

  void text(Spot at, std::string_view words, double size, Align align, Colour colour, bool upright) override {
    const char* anchor = align == Align::left ? "start" : align == Align::centre ? "middle" : "end";
    const std::string turn = upright ? "" : fmt::format(" transform=\"rotate(-90 {:.2f} {:.2f})\"", at.x, at.y);
    body_ += fmt::format("<text x=\"{:.2f}\" y=\"{:.2f}\" font-size=\"{}\" text-anchor=\"{}\" fill=\"{}\"{}>{}</text>\n",
                         at.x, at.y, size, anchor, web(colour), turn, escaped(words));
  }

  void picture(Spot corner, double width, double height, const Picture& picture) override {
    const std::string png = encode_png(picture);
    const std::string text = base64({reinterpret_cast<const std::uint8_t*>(png.data()), png.size()});
    body_ += fmt::format("<image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" href=\"data:image/png;base64,{}\"/>\n",
                         corner.x, corner.y, width, height, text);
  }

  std::string bytes() const override { return head_ + body_ + "</svg>\n"; }

 private:
  std::string head_, body_;
};

}  // namespace

void Canvas::dot(Spot centre, double radius, Colour colour) {
  std::vector<Spot> outline;
  for (int i = 0; i < 24; ++i) {
    const double angle = 2 * std::numbers::pi * i / 24;
    outline.push_back({centre.x + radius * std::cos(angle), centre.y + radius * std::sin(angle)});
  }
  area(std::span(&outline, 1), colour);
}

void Canvas::box(Spot corner, double width, double height, Colour colour) {
  const std::vector<Spot> outline = {
      corner, {corner.x + width, corner.y}, {corner.x + width, corner.y + height}, {corner.x, corner.y + height}};
  area(std::span(&outline, 1), colour);
}

std::unique_ptr<Canvas> svg_canvas(double width, double height) { return std::make_unique<SvgCanvas>(width, height); }

}  // namespace palpate::report
