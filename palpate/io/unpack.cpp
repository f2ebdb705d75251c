// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/unpack.hpp"

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include <memory>

namespace palpate::io {
namespace {

constexpr std::uint64_t largest_block = std::uint64_t{1} << 31;

bool unpack_lz4(std::string_view packed, std::string& out) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) return false;
  std::size_t read = 0, written = 0, hint = 1;
  while (hint != 0 && read < packed.size()) {
    std::size_t in = packed.size() - read, room = out.size() - written;
    hint = LZ4F_decompress(context, out.data() + written, &room, packed.data() + read, &in, nullptr);
    if (LZ4F_isError(hint) || (in == 0 && room == 0)) break;
    read += in;
    written += room;
  }
  LZ4F_freeDecompressionContext(context);
  return written == out.size();
}

bool unpack_bz2(std::string_view packed, std::string& out) {
  auto size = static_cast<unsigned>(out.size());
  // The library does not change its input; its interface is older than const.
  return BZ2_bzBuffToBuffDecompress(out.data(), &size, const_cast<char*>(packed.data()),
                                    static_cast<unsigned>(packed.size()), 0, 0) == BZ_OK &&
         size == out.size();
}

}  // namespace

std::optional<std::string> unpack(std::string_view packed, const std::string& compression, std::uint64_t size) {
  if (size > largest_block || packed.size() > largest_block) return std::nullopt;
  if (compression.empty() || compression == "none")
    return packed.size() == size ? std::optional<std::string>(packed) : std::nullopt;
  std::string out(size, '\0');
  bool good = false;
  if (compression == "zstd") {
    const std::size_t written = ZSTD_decompress(out.data(), out.size(), packed.data(), packed.size());
    good = !ZSTD_isError(written) && written == size;
  } else if (compression == "lz4") {
    good = unpack_lz4(packed, out);
  } else if (compression == "bz2") {
    good = unpack_bz2(packed, out);
  }
  return good ? std::optional<std::string>(std::move(out)) : std::nullopt;
}

std::optional<std::string> unpack_zstd(std::string_view packed) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(), ZSTD_freeDStream);
  std::string out, piece(ZSTD_DStreamOutSize(), '\0');
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  std::size_t left = 1;
  while (in.pos < in.size) {
    ZSTD_outBuffer to{piece.data(), piece.size(), 0};
    left = ZSTD_decompressStream(stream.get(), &to, &in);
    if (ZSTD_isError(left) || out.size() > largest_block) return std::nullopt;
    out.append(piece, 0, to.pos);
    if (left == 0) continue;  // the end of a frame; another may follow
  }
  if (left != 0) return std::nullopt;
  return out;
}

}  // namespace palpate::io
